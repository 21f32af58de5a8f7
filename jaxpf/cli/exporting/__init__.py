"""``jaxpf export``."""
