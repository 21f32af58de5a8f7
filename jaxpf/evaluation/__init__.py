"""Monte-Carlo evaluations: many runs of many methods on one scene, kept on disk."""

from jaxpf.evaluation.batches import Batch
from jaxpf.evaluation.engine import Prepared, carry_out, evaluate, finished, prepare
from jaxpf.evaluation.execution import local_pool
from jaxpf.evaluation.plan import Limits, Plan
from jaxpf.evaluation.results import Configuration, Results

__all__ = [
    "Batch",
    "Configuration",
    "Limits",
    "Plan",
    "Prepared",
    "Results",
    "carry_out",
    "evaluate",
    "finished",
    "local_pool",
    "prepare",
]
