"""``tune``: minimise a loss over tracker parameters with Adam."""

import dataclasses
import functools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.files.store import Store
from jaxpf.gradients import check_motion_gradient
from jaxpf.lowering.programs import compiled
from jaxpf.tuning import checkpoint
from jaxpf.tuning.parameters import Parameter, check_apart, parameter, read
from jaxpf.tuning.problem import TrainingSequence, check_objective, free_loss, ready
from jaxpf.tuning.result import Descent, Result, summarise
from jaxpf.tuning.settings import Settings
from jaxpf.tuning.uncertainty import curvature

#: Steps between two checkpoints.
_STEPS_PER_CHECKPOINT = 10


class Diverged(InputError):
    """The loss became infinite or NaN; ``result`` holds the values of the last finite step."""

    def __init__(self, sentence: str, result: Result):
        super().__init__(sentence)
        self.result = result


def tune(
    sequences: TrainingSequence | Sequence[TrainingSequence],
    parameters: Sequence[str | Parameter],
    *,
    objective: str | Callable = "evidence",
    settings: Settings | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[Descent], None] | None = None,
) -> Result:
    """Find the parameter values that fit sequences best.

    The gradient is that of the trackers' field ``gradient`` (``jaxpf.gradients``).  By default it
    leaves out resampling: the result then differs from the maximum of the likelihood, however many
    particles there are; ``StopGradient()`` has a bias of order 1/N.  Tuning a motion noise
    requires a likelihood that is differentiable in the state (``interpolation="bilinear"``) or
    dynamics with ``log_density``.

    Example::

        sequence = jaxpf.tuning.TrainingSequence(tracker, y)
        result = jaxpf.tune(sequence, ["parameters.a=0:1"])
        result.values

    Args:
        sequences: one or several; their trackers share the parameters.  A sequence holds what was
            ``observed``, and its ``inputs``.
        parameters: paths such as "likelihood.sharpness", "dynamics.scale[0]", "parameters.a" of
            ``jaxpf.state_space`` or, with bounds, "likelihood.sharpness=1:500"; see ``Parameter``.
        objective: what is minimised.  "evidence": minus the log evidence per frame, averaged over
            runs; the mean of the logs lies below the log evidence by about half its variance, so
            this also rewards a low variance (Maddison et al., "Filtering variational objectives",
            NeurIPS 2017).  "position": mean distance from the labelled positions, pixels.  "crps":
            continuous ranked probability score of the labelled positions, pixels.  "iou": 1 -
            intersection over union with the labelled shapes.  Or a function ``(tracker, keys,
            frames) -> [R]``, of which the mean is minimised; if a sequence says which frames were
            ``observed``, frames are pairs ``(frame, seen)``, as its tracker takes them.
        settings: default ``Settings()``.
        folder: existing folder for a checkpoint; repeating the call resumes from it.
        progress: called with the descent after every step.

    Returns:
        Values, their uncertainty, and traces.

    Raises:
        Diverged: the loss is not finite.  The last finite values are kept, also in ``folder``.
    """
    settings = Settings() if settings is None else settings
    sequences = [sequences] if isinstance(sequences, TrainingSequence) else list(sequences)
    check_objective(objective, sequences)
    parsed = [each if isinstance(each, Parameter) else parameter(each) for each in parameters]
    check_apart(parsed)
    start = {each.path: read(sequences[0].tracker, each) for each in parsed}
    for sequence in sequences:
        for each in parsed:
            if read(sequence.tracker, each).shape != start[each.path].shape:
                raise InputError(
                    f"the parameter {each.path} of {sequence.name} has another shape than that of "
                    f"{sequences[0].name}; tune sequences of the same kind together."
                )
        if any(each.name.startswith("dynamics.") for each in parsed):
            check_motion_gradient(sequence.tracker)
    name = objective if isinstance(objective, str) else getattr(objective, "__qualname__", "own")
    asked = checkpoint.described(
        dataclasses.asdict(settings)
        | {"parameters": [f"{each.path}={each.low}:{each.high}" for each in parsed]}
        | {"objective": name, "start": start}
        | {"sequences": [each.name for each in sequences]}
        | {"frames": [(each.frames, each.observed, each.inputs) for each in sequences]}
        | {"labels": [(each.truth,) for each in sequences]}
        | {"tracker": [each.tracker for each in sequences]}
    )
    store = None if folder is None else Store(Path(folder), "remove it, or choose another folder")
    if store is not None and (old := store.settings()) is not None:
        store.check_same(old, asked)
    prepared = [ready(sequence) for sequence in sequences]
    value_and_gradient = free_loss(objective, tuple(parsed), sequences[0].outlines)
    descents: list[Descent] = []
    for repeat in range(settings.repeats):
        descents.append(checkpoint.read(store, _begin(parsed, start, settings, repeat)))
        try:
            for done in _descend(descents[-1], prepared, value_and_gradient, settings):
                descents[-1] = done
                if store is not None and done.num_steps % _STEPS_PER_CHECKPOINT == 0:
                    checkpoint.write(store, asked, done)
                if progress is not None:
                    progress(done)
        except _NotFinite as error:
            result = summarise(parsed, start, descents, settings)
            where = f"step {descents[-1].num_steps + 1}, repeat {repeat + 1}"
            values = ", ".join(f"{name} = {_shown(x)}" for name, x in result.last_good.items())
            raise Diverged(
                f"the loss became {error} of {where}; the last good values are {values}: "
                "start elsewhere, narrow the bounds or lower the learning rate.",
                result,
            ) from None
        finally:
            # Without a step there is nothing to resume, and the next call may have other settings.
            if store is not None and descents[-1].num_steps:
                checkpoint.write(store, asked, descents[-1])
    result = summarise(parsed, start, descents, settings)
    if objective == "evidence":
        errors, reason = curvature(result, parsed, prepared, value_and_gradient, settings)
        result = dataclasses.replace(result, curvature_errors=errors, no_curvature=reason)
    return result


class _NotFinite(Exception):
    """What the loss became, and on which sequence."""


def _shown(value: ArrayLike) -> str:
    numbers = np.ravel(value)
    return ", ".join(f"{x:.6g}" for x in numbers[:6]) + (", ..." if len(numbers) > 6 else "")


def _check_moved(gradients: Sequence[dict[str, jax.Array]]) -> None:
    """Refuse a parameter that no particle's path depends on: its gradient is 0 in every run."""
    for name in gradients[0]:
        if not any(np.any(np.asarray(each[name])) for each in gradients):
            raise InputError(
                f"the gradient in {name} is exactly 0 in the first step, so nothing would tune it. "
                "Either nothing uses it, or it acts through integers or steps, which have no "
                "slope: use a tracker with motion_gradient='score', or leave it out."
            )


@functools.lru_cache(maxsize=8)
def _optimiser(clip: float, learning_rate: float) -> tuple[Any, Callable]:
    """Adam with gradient clipping, and its compiled update."""
    adam = optax.chain(optax.clip_by_global_norm(clip), optax.adam(learning_rate))

    @compiled
    def step(gradients, free, moments):
        mean = jax.tree.map(lambda *g: sum(g) / len(g), *gradients)
        change, moments = adam.update(mean, moments)
        return optax.apply_updates(free, change), moments, _norm(mean)

    return adam, step


def _norm(tree: object) -> jax.Array:
    return jnp.sqrt(sum(jnp.sum(leaf**2) for leaf in jax.tree.leaves(tree)))


def _begin(
    parameters: Sequence[Parameter], start: dict[str, jax.Array], settings: Settings, repeat: int
) -> Descent:
    rng = np.random.default_rng([settings.seed, repeat])
    free = {}
    for each in parameters:
        z = np.asarray(each.to_free(start[each.path]), float)
        free[each.path] = z if repeat == 0 else z + settings.jitter * rng.standard_normal(z.shape)
    moments = jax.tree.leaves(
        _optimiser(settings.clip, settings.learning_rate)[0].init(_on_device(free))
    )
    return Descent(
        repeat=repeat,
        free={name: np.asarray(z)[None] for name, z in free.items()},
        loss=np.zeros(0),
        gradient_norm=np.zeros(0),
        moments=[np.asarray(x) for x in moments],
        stopped="",
    )


def _on_device(free: dict[str, np.ndarray]) -> dict[str, jax.Array]:
    return {name: jnp.asarray(z, float) for name, z in free.items()}


def _descend(descent, sequences, value_and_gradient, settings):
    """Yield the descent after every step until it stops."""
    optimiser, take_step = _optimiser(settings.clip, settings.learning_rate)
    free = _on_device({name: trace[-1] for name, trace in descent.free.items()})
    structure = jax.tree.structure(optimiser.init(free))
    moments = jax.tree.unflatten(structure, [jnp.asarray(x) for x in descent.moments])
    key = jax.random.fold_in(jax.random.key(settings.seed), descent.repeat)
    while not descent.stopped:
        step = descent.num_steps
        gradients, losses = [], []
        for place in _of_step(step, len(sequences), settings):
            sequence = sequences[place]
            fresh = jax.random.fold_in(jax.random.fold_in(key, step), place)
            keys = jax.random.split(fresh, settings.runs)
            loss, gradient = value_and_gradient(
                free, sequence.tracker, keys, sequence.frames, sequence.truth, sequence.sizes
            )
            norm = float(_norm(gradient))
            if not (np.isfinite(float(loss)) and np.isfinite(norm)):
                value = "infinite" if np.isinf(float(loss)) else "no number"
                if np.isfinite(float(loss)):
                    value = f"{float(loss):.4g} with a gradient that is not finite"
                raise _NotFinite(f"{value} on {sequence.name}")
            losses.append(float(loss))
            gradients.append(gradient)
        if step == 0:
            _check_moved(gradients)
        free, moments, norm = take_step(gradients, free, moments)
        descent = dataclasses.replace(
            descent,
            free={
                name: np.concatenate([descent.free[name], np.asarray(z)[None]])
                for name, z in free.items()
            },
            loss=np.append(descent.loss, np.mean(losses)),
            gradient_norm=np.append(descent.gradient_norm, float(norm)),
            moments=[np.asarray(x) for x in jax.tree.leaves(moments)],
        )
        descent = dataclasses.replace(descent, stopped=_reason_to_stop(descent, settings))
        yield descent


def _of_step(step: int, count: int, settings: Settings) -> list[int]:
    """Indices of the sequences used in a step: all, or the requested number in rotation."""
    number = min(settings.sequences_per_step or count, count)
    return [(step * number + i) % count for i in range(number)]


def _reason_to_stop(descent: Descent, settings: Settings) -> str:
    steps, window = descent.num_steps, settings.window
    if steps >= 2 * window:
        moved = max(
            float(np.max(np.abs(z[-window:].mean(axis=0) - z[-2 * window : -window].mean(axis=0))))
            for z in descent.free.values()
        )
        if moved < settings.tolerance:
            return "settled"
    return "all steps" if steps >= settings.steps else ""
