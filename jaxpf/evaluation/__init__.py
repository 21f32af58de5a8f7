"""Monte-Carlo evaluations: many runs of many methods on one scene, kept on disk."""

from jaxpf.evaluation.batches import Batch
from jaxpf.evaluation.results import Configuration, Results

__all__ = ["Batch", "Configuration", "Results"]
