"""The labelled filter: each particle holds one of many targets (rowe2005)."""

from jaxpf.filters.labelled.population import born, ended, homes
from jaxpf.filters.labelled.state import LabelledState, LabelledSummary
from jaxpf.filters.labelled.tracker import Labelled

__all__ = ["Labelled", "LabelledState", "LabelledSummary", "born", "ended", "homes"]
