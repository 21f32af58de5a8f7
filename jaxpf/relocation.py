"""Where objects that are probably lost may be."""

from jaxpf.filters.relocation import Relocation, relocation_in

__all__ = ["Relocation", "relocation_in"]
