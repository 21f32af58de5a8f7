"""``python -m jaxpf.cli``."""

from jaxpf.cli import main

main()
