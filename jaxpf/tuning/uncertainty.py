"""How well the frames determine tuned values: the curvature of the log evidence."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.tuning.parameters import Parameter
from jaxpf.tuning.problem import TrainingSequence
from jaxpf.tuning.result import Result
from jaxpf.tuning.settings import Settings

#: Difference in the unconstrained numbers between the gradients that are compared.
_STEP = 0.15
#: Runs per gradient, as a multiple of those of a step: differences are small next to their noise.
_RUNS = 4
#: Maximum number of parameters; more would cost more than the descent.
_MOST = 12


def curvature(
    result: Result,
    parameters: Sequence[Parameter],
    sequences: Sequence[TrainingSequence],
    value_and_gradient: Callable,
    settings: Settings,
) -> tuple[dict[str, np.ndarray], str]:
    """Standard errors of the unconstrained numbers from the observed information: path -> errors.

    The information is minus the second derivative of the log evidence of all sequences.  It is
    estimated by central differences of the gradient, .15 on either side, with common random
    numbers.  Its inverse is the covariance of the maximum-likelihood estimate, if the model is
    right and there are many frames.  Unknown errors are NaN; the second return value says why, or
    is "".
    """
    sizes = [np.size(result.free[parameter.path]) for parameter in parameters]
    none = {name: np.full(np.shape(z), np.nan) for name, z in result.free.items()}
    total = sum(sizes)
    if total > _MOST:
        return none, f"{total} numbers are too many for their curvature"
    centre = np.concatenate([np.ravel(result.free[parameter.path]) for parameter in parameters])
    edges = np.cumsum(sizes)[:-1]
    key = jax.random.fold_in(jax.random.key(settings.seed), 2**31 - 1)

    def gradient(point: np.ndarray) -> np.ndarray:
        parts = np.split(point, edges)
        free = {
            parameter.path: jnp.asarray(part.reshape(np.shape(result.free[parameter.path])), float)
            for parameter, part in zip(parameters, parts, strict=True)
        }
        sum_: Any = np.zeros(total)
        for place, sequence in enumerate(sequences):
            for batch in range(_RUNS):
                keys = jax.random.split(
                    jax.random.fold_in(jax.random.fold_in(key, place), batch), settings.runs
                )
                _, slope = value_and_gradient(
                    free, sequence.tracker, keys, sequence.frames, sequence.truth, sequence.sizes
                )
                flat = np.concatenate([np.ravel(slope[parameter.path]) for parameter in parameters])
                sum_ = sum_ + flat * sequence.num_frames / _RUNS
        return sum_

    information = np.zeros((total, total))
    for place in range(total):
        shift = np.zeros(total)
        shift[place] = _STEP
        information[place] = (gradient(centre + shift) - gradient(centre - shift)) / (2 * _STEP)
    information = (information + information.T) / 2
    if not np.isfinite(information).all():
        return none, "the gradient beside the values found is not finite"
    if np.linalg.eigvalsh(information).min() <= 0:
        return none, "the values found are no clear maximum of the evidence"
    errors = np.sqrt(np.diag(np.linalg.inv(information)))
    return {
        parameter.path: part.reshape(np.shape(result.free[parameter.path]))
        for parameter, part in zip(parameters, np.split(errors, edges), strict=True)
    }, ""
