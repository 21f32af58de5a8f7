"""``jaxpf tune``."""
