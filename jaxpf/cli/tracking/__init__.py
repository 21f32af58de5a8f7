"""``jaxpf track``."""
