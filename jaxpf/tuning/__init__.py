"""Tuning parameters of trackers by gradient descent, instead of trial and error.

Name parameters by their path in the tracker, choose an objective, and get values, their
uncertainty, and a comparison on sequences that tuning did not see.
"""

from jaxpf.tuning.comparison import Comparison, compare
from jaxpf.tuning.loop import Diverged, tune
from jaxpf.tuning.orders import Pilot, best_order, candidate_orders
from jaxpf.tuning.parameters import Parameter, names, parameter, read, replace
from jaxpf.tuning.problem import OBJECTIVES, TrainingSequence, loss_function
from jaxpf.tuning.result import Descent, Result
from jaxpf.tuning.sequences import Recipe, held_out, training_sequence
from jaxpf.tuning.settings import RANDOM_NUMBERS, Settings

__all__ = [
    "OBJECTIVES",
    "RANDOM_NUMBERS",
    "Comparison",
    "Descent",
    "Diverged",
    "Parameter",
    "Pilot",
    "Recipe",
    "Result",
    "Settings",
    "TrainingSequence",
    "best_order",
    "candidate_orders",
    "compare",
    "held_out",
    "loss_function",
    "names",
    "parameter",
    "read",
    "replace",
    "training_sequence",
    "tune",
]
