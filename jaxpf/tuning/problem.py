"""The tuning problem: training sequences with their trackers, and the loss of a sequence."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import likelihood_of, optional
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import with_nan
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.refusals import biased_evidence
from jaxpf.contract.types import TrackerLike
from jaxpf.lowering.programs import compiled
from jaxpf.running import runs
from jaxpf.running.frames import as_arrays, num_frames
from jaxpf.running.missing_frames import WithGaps
from jaxpf.tuning import objectives
from jaxpf.tuning.parameters import Parameter, replace

#: Names of objectives.
OBJECTIVES = ("evidence", "position", "iou", "crps")

#: Maximum bytes for precomputed observations; larger ones are recomputed at every step.
_KEPT_OBSERVATIONS = 512 * 2**20


@dataclasses.dataclass(frozen=True)
class TrainingSequence:
    """A sequence to tune on.

    Attributes:
        tracker: starts just before the first frame.
        frames: array or pytree, leading axis T.
        truth: labels of supervised objectives, NaN where missing: ``[T, P, 4]`` boxes x, y, w, h
            for "iou"; ``[T, P, >= 2]``, the centre first, for "position" and "crps".
        sizes: ``[P, 2]``, width and height at scale 1, for "iou".
        name: name in messages.
        outlines: for "iou" of shapes other than boxes: a function of shapes ``[..., P, S]``,
            such as ``truth``, and of ``sizes``; see ``Target.outlines``.
        observed: which frames or parts of them were seen, as for ``jaxpf.run``.
        inputs: known inputs of the frames, as for ``jaxpf.run``.
    """

    tracker: Any
    frames: Any
    truth: ArrayLike | None = None
    sizes: ArrayLike | None = None
    name: str = "the sequence"
    outlines: Callable | None = None
    observed: Any = None
    inputs: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", as_arrays(self.frames))
        object.__setattr__(self, "truth", with_nan(self.truth))

    @property
    def num_frames(self) -> int:
        """T."""
        return len(jax.tree.leaves(self.frames)[0])


def check_objective(objective: object, sequences: Sequence[TrainingSequence]) -> None:
    """Refuse an unknown objective, or one whose labels are missing."""
    if not sequences:
        raise InputError("there is no sequence to tune on; give at least one.")
    if callable(objective):
        return
    check_known("objective ", objective, OBJECTIVES)
    for sequence in sequences:
        if objective == "evidence":
            otherwise = "an objective that reads the labels"
            biased_evidence(sequence.tracker, "the objective 'evidence'", otherwise, tuning=True)
            if optional(likelihood_of(sequence.tracker), "form") == "exponential":
                raise InputError(
                    "the evidence of exp(-sharpness d^2) always prefers sharpness 0, because it is "
                    "not normalised; make the histogram with form='density' or 'ratio', or choose "
                    "the objective 'position', 'crps' or 'iou'."
                )
        elif sequence.truth is None:
            raise InputError(
                f"objective {objective!r} needs labels, but {sequence.name} has none; give its "
                "truth, or use 'evidence'."
            )
        elif objective == "iou" and sequence.sizes is None:
            raise InputError(f"objective 'iou' needs the sizes of {sequence.name}; give them.")


def loss_function(objective: str | Callable, outlines: Callable | None = None) -> Callable:
    """The loss of a sequence, ``(tracker, keys, frames, truth, sizes) -> []``; see ``tune``."""

    def loss(tracker, keys, frames, truth, sizes):
        if callable(objective):
            return jnp.mean(objective(tracker, keys, frames))
        run = tracker, keys, frames
        if objective == "evidence":
            num_frames = len(jax.tree.leaves(frames)[0])
            return -jnp.mean(objectives.log_evidence(*run)) / num_frames
        if objective == "position":
            return jnp.mean(objectives.position_error(*run, truth))
        if objective == "crps":
            return jnp.mean(objectives.crps_loss(*run, truth))
        if outlines is None:
            return jnp.mean(objectives.iou_loss(*run, truth, sizes))
        true = outlines(truth, sizes)
        return jnp.mean(objectives.outline_loss(*run, true, lambda x: outlines(x, sizes)))

    return loss


@functools.lru_cache(maxsize=8)
def free_loss(
    objective: str | Callable, parameters: tuple[Parameter, ...], outlines: Callable | None = None
) -> Callable:
    """Value and gradient of the loss in unconstrained numbers z (path -> array).

    Returns a function of ``(z, tracker, keys, frames, truth, sizes)``, compiled once per shape.
    """
    loss = loss_function(objective, outlines)

    def of_free(free, tracker, keys, frames, truth, sizes):
        values = {
            parameter.path: parameter.to_value(free[parameter.path]) for parameter in parameters
        }
        return loss(_with(tracker, values), keys, frames, truth, sizes)

    return compiled(jax.value_and_grad(of_free))


def _with(tracker: TrackerLike, values: Mapping[str, ArrayLike]) -> Any:
    if isinstance(tracker, Observed | WithGaps):
        return type(tracker)(_with(tracker.tracker, values))
    return replace(tracker, values)


@pytree_dataclass
class Observed(contract.WrappedTracker):
    """A tracker whose frames are already observations."""

    tracker: Any

    is_marked = True

    def observe(self, frame):
        """Return the frame."""
        return frame

    def step_observed(self, key, state, observation):
        """Step the tracker."""
        return self.tracker.step_observed(key, state, observation)


def ready(sequence: TrainingSequence) -> TrainingSequence:
    """Let a sequence's tracker know what is missing, and the inputs; observe frames in advance.

    The latter only if the observations do not depend on parameters, and fit in memory.
    """
    frames = sequence.frames  # arrays since it was made
    tracker = runs.with_rows(sequence.tracker, sequence.inputs, num_frames(frames))
    is_fixed = optional(likelihood_of(tracker), "fixed_observation")
    # Else objectives mark frames of NaN themselves; those of users may read the filter's fields.
    if is_fixed or sequence.observed is not None:
        tracker, frames = runs.ready(tracker, frames, sequence.observed)
    if is_fixed:
        frames = jax.device_put(frames)
        observe = calls.observed_apart(tracker)[0]
        one = jax.eval_shape(observe, jax.tree.map(lambda x: x[0], frames))
        size = sum(math.prod(x.shape) * np.dtype(x.dtype).itemsize for x in jax.tree.leaves(one))
        if size * sequence.num_frames <= _KEPT_OBSERVATIONS:
            frames = compiled(lambda frames: jax.lax.map(observe, frames))(frames)
            tracker = Observed(tracker)
    return dataclasses.replace(sequence, tracker=tracker, frames=frames, observed=None, inputs=None)
