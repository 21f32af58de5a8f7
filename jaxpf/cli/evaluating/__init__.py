"""``jaxpf evaluate``."""
