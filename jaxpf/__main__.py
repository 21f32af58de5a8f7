"""``python -m jaxpf``."""

from jaxpf.cli import main

main()
