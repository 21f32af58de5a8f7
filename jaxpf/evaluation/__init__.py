"""Monte-Carlo evaluations: many runs of many methods on one scene, kept on disk."""

from jaxpf.evaluation.plan import Limits, Plan
from jaxpf.evaluation.results import Configuration, Results
from jaxpf.evaluation.work.batches import Batch
from jaxpf.evaluation.work.engine import Prepared, carry_out, evaluate, finished, prepare
from jaxpf.evaluation.work.execution import local_pool

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
