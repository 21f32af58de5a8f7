"""Factored filters: every partition has particles of its own (PFFL, eskil2014)."""

from jaxpf.filters.factored.drift import Motion, correlations
from jaxpf.filters.factored.eskil import Eskil
from jaxpf.filters.factored.pffl import PFFL

__all__ = ["PFFL", "Eskil", "Motion", "correlations"]
