"""Runs of every variant of the labelled filter on projectiles, and of Condensation on two modes."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.stats import norm

import jaxpf
import scenes
from jaxpf.boxes.rowe2005 import Rowe2005Settings
from jaxpf.contract.state import Summary
from jaxpf.evaluation.engine import run_keys
from jaxpf.filters.labelled.state import LabelledState
from jaxpf.lowering.programs import compiled
from jaxpf.papers.checkpoints import Measurements
from jaxpf.shapes.rectangles import area, intersection_area
from scenes import Scene

#: N and T of the paper's synthetic test.
PARTICLES, FRAMES = 100, 300
#: Runs per scene: claims about the variance between runs need several.
RUNS_PER_SCENE = 4
#: Of section 2, runs whose expectations are compared.
RUNS = 20
#: Modes at -1 and 1: standard deviation of each, and of the motion per frame.
_WIDTH, _MOTION = 0.1, 0.05
#: Chosen separately for each variant; see ``settings.csv``.
TUNED = {
    "both": Rowe2005Settings(),
    "neither": Rowe2005Settings(2.5, 0.02, 1.2, 40.0, 1.0, 0.5, (0.9, 0.4)),
    "feedback only": Rowe2005Settings(1.5, 0.05, 1.2, 50.0, 1.0, 0.25, (0.9, 0.4)),
    "without eq. 4": Rowe2005Settings(1.5, 0.05, 1.2, 50.0, 1.0, 0.12, (0.9, 0.4)),
    "Condensation": Rowe2005Settings(2.5, 0.1, 1.2, 40.0, 1.0, 0.5, (0.9, 0.4)),
    "product": Rowe2005Settings(1.5, 0.02, 1.2, 80.0, 1.0, 1.0, (0.9, 0.4)),
}
SETTINGS = TUNED["both"]
#: Variant -> differences from the paper's filter, which has eq. 4, feedback and regularisation.
VARIANTS: dict[str, dict[str, Any]] = {
    "both": {},
    "neither": {"feedback": "none", "rates": (1.0, 1.0)},
    "regularising only": {"feedback": "none"},
    "feedback only": {"rates": (1.0, 1.0)},
    "without eq. 4": {"weights": "plain"},
    "Condensation": {"weights": "plain", "feedback": "none", "rates": (1.0, 1.0)},
    "eq. 4 corrected": {"weights": "corrected"},
    "systematic": {"resampling": "systematic"},
    # Needs no power: the product is sharp enough.
    "product": {"pool": "product", "min_slope": 0.0},
    "without size term": {"size_term": 0.0},
    "without power": {"min_slope": 0.0},
}


def settings_of(variant: str) -> Rowe2005Settings:
    """The settings of a variant: its own, or those of the filter that it modifies.

    Without feedback, regularisation only changes the reported values, so "regularising only" has
    the settings of "neither".  Weight correction and resampling need no other noise than the full
    filter.  The effect of the size term is measured at the noise of the full filter.  Without
    power, all targets were lost with every setting tried.
    """
    if variant == "regularising only":
        return TUNED["neither"]._replace(rates=SETTINGS.rates)
    return TUNED.get(variant, SETTINGS)


def tracker_of(scene: Scene, variant: str) -> jaxpf.Labelled:
    """The tracker of a variant on a scene whose targets have patches."""
    return jaxpf.boxes.tracker(
        scene.frames[0],
        scene.boxes[0],
        like="rowe2005",
        patches=scene.patches,
        num_particles=PARTICLES,
        **(settings_of(variant)._asdict() | VARIANTS[variant]),
    )


def measure(
    seeds: Sequence[int],
    variants: tuple[str, ...],
    measurements: Measurements,
    paths: str = "apart",
) -> dict[str, dict[str, np.ndarray]]:
    """Run variants ``RUNS_PER_SCENE`` times on the scene of each seed; see ``settings_of``.

    ``paths`` is a parameter of the scene.  A run's random numbers depend only on its seed and
    number, which all variants share.

    Returns:
        Variant -> arrays of S scenes, R runs, T frames and L targets: ``error`` ``[S, R, T, L]``,
        distance of the centres divided by the root of the true area; ``area_ratio`` as it,
        estimated over true area; ``share`` as it, the target's share of the particles;
        ``astray`` ``[S, R, T]``, share of particles whose box misses their target's true box;
        ``between`` ``[S]``, see ``deviation_between``; ``within`` ``[S]``, the same for particles
        within a run; ``in_strip`` ``[S, T, L]`` bool, the true box overlaps a strip.
    """
    found = measurements.of_scenes(paths, partial(_on_scene, variants, paths), seeds)
    in_strip = found.pop("in_strip")
    return {
        variant: {name: values[:, place] for name, values in found.items()} | {"in_strip": in_strip}
        for place, variant in enumerate(variants)
    }


def _on_scene(variants: Sequence[str], paths: str, seed: int) -> dict[str, np.ndarray]:
    """The arrays of ``measure`` of one scene, ``[V, ...]`` but for ``in_strip``."""
    scene = scenes.make("projectiles", seed=seed, paths=paths)
    keys = run_keys(seed, 0, RUNS_PER_SCENE)
    frames, truth = jnp.asarray(scene.frames[1:]), np.asarray(scene.boxes[1:], np.float32)
    measured = []
    for variant in variants:
        tracker = tracker_of(scene, variant)
        recorded = jaxpf.monte_carlo(tracker, keys, frames, _record, batch_size=RUNS_PER_SCENE)
        measured.append(_measures(recorded, truth))
    stacked = jax.tree.map(lambda *values: np.stack(values), *measured)
    return {**stacked, "in_strip": _in_strip(truth, scene.extras["strips"])}


def _in_strip(boxes: np.ndarray, strips: np.ndarray) -> np.ndarray:
    left, right = boxes[..., 0, None], boxes[..., 0, None] + boxes[..., 2, None]
    return np.any((left < strips[:, 1]) & (right > strips[:, 0]), axis=-1)


def _record(state: LabelledState, summary: Summary) -> tuple[jax.Array, ...]:
    """Reported values, and every particle's box and label."""
    reported = summary.estimate, summary.distinct_share, summary.spread[..., :2]
    return *reported, state.lagged[0, :4], state.labels


@compiled
def _measures(recorded: tuple[jax.Array, ...], truth: jax.Array) -> dict[str, jax.Array]:
    estimate, share, spread, particles, labels = recorded
    centres = truth[..., :2] + truth[..., 2:] / 2
    error = jnp.linalg.norm(estimate[..., :2] - centres, axis=-1) / jnp.sqrt(area(truth))
    ratio = estimate[..., 2] * estimate[..., 3] / area(truth)
    particles = jnp.moveaxis(particles, -2, -1)
    boxes = jnp.concatenate([particles[..., :2] - particles[..., 2:] / 2, particles[..., 2:]], -1)
    own = jnp.take_along_axis(truth[None], labels[..., None], axis=2)
    astray = jnp.mean(intersection_area(boxes, own) <= 0, axis=-1)
    between = deviation_between(estimate[..., :2], share > 0, area(truth))
    within = jnp.sqrt(jnp.nanmean(jnp.sum(spread**2, axis=-1) / area(truth)))
    return {
        "error": error,
        "area_ratio": ratio,
        "share": share,
        "astray": astray,
        "between": between,
        "within": within,
    }


def deviation_between(places: jax.Array, counts: jax.Array, areas: jax.Array) -> jax.Array:
    """Deviation of the runs' estimates from their mean, divided by the root of the true area.

    Root mean square over runs, frames and targets that count in at least two runs; NaN without any.

    Args:
        places: estimates, pixels.
        counts: ``[R, T, L]`` bool, whether the target has particles.
        areas: ``[T, L]``.
    """
    number = counts.sum(axis=0)
    mean = jnp.where(counts[..., None], places, 0).sum(axis=0) / jnp.maximum(number, 1)[..., None]
    squares = jnp.sum((places - mean) ** 2, axis=-1) / areas * number / jnp.maximum(number - 1, 1)
    counts &= number > 1
    return jnp.sqrt(jnp.where(counts, squares, 0).sum() / counts.sum())


def stability(seed: int) -> float:
    """Deviation of the expectations between runs over that within a run, root mean squares.

    Section 2: Condensation on two equal modes, such as a target and something that looks like it.
    Of N particles on two modes that explain every frame equally well, one mode dies out by chance
    in the end, as by genetic drift.  A run then looks stable, while runs differ by the mode that is
    left.
    """
    keys = jax.random.split(jax.random.key(seed), RUNS)
    return between_over_within(np.asarray(_expectations(keys)))


def between_over_within(expectations: np.ndarray) -> float:
    """Deviation over runs, at each frame, over deviation over frames, in each run; ``[R, T]``."""
    between = expectations.var(axis=0, ddof=1).mean()
    within = expectations.var(axis=1, ddof=1).mean()
    return float(np.sqrt(between / within))


@compiled
def _expectations(keys: jax.Array) -> jax.Array:
    """``[R, T]``: the mean of the particles of each run in each frame."""
    condensation = jaxpf.state_space(
        initial=_either,
        transition=lambda key, x, parameters: x + _MOTION * jax.random.normal(key),
        log_likelihood=lambda y, x, parameters: jnp.logaddexp(
            norm.logpdf(x, -1, _WIDTH), norm.logpdf(x, 1, _WIDTH)
        ),
        num_particles=PARTICLES,
        resampling="multinomial",
    )
    frames = jnp.zeros(FRAMES)
    _, summaries = jax.vmap(lambda key: jaxpf.run(condensation, key, frames))(keys)
    return summaries.estimate[..., 0, 0]


def _either(key: jax.Array, parameters: object) -> jax.Array:
    """A state near one mode or the other, with equal chances."""
    side, near = jax.random.split(key)
    return jnp.where(jax.random.bernoulli(side), 1.0, -1.0) + _WIDTH * jax.random.normal(near)
