"""``jaxpf bench``: each figure is timed together with its baseline."""
