"""Sections of ``jaxpf bench``; each lists cases to time and their baselines."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.cli.benchmarks import problems, rivals
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.likelihoods.histogram import histogram
from jaxpf.measures.timing import interleaved, median_interval

RUNS, PARTICLES, OBJECTS = 50, 300, 7


class Case(NamedTuple):
    """A case to time.

    Attributes:
        what: name.
        run: computes the case once.
        units: particles times partitions times frames of one call; times are divided by it.
        baseline: name of the case to compare with; "" for none.
        goal: this project's target for the ratio.
    """

    what: str
    run: Callable[[], Any]
    units: float
    baseline: str = ""
    goal: str = ""


class Section(NamedTuple):
    """Cases that are timed alternately."""

    title: str
    cases: list[Case]

    def measure(self, repeats: int) -> list[tuple[float, tuple[float, float, float]]]:
        """Median nanoseconds per unit of every case, and its ratio to the baseline's time.

        Ratios are medians of interleaved pairs with a 95 % interval; 1 without a baseline.
        """
        runs = {case.what: case.run for case in self.cases}
        seconds = interleaved(runs, repeats)
        each = {case.what: 1e9 * seconds[case.what] / case.units for case in self.cases}
        return [
            (
                float(np.median(each[case.what])),
                median_interval(each[case.what] / each[case.baseline or case.what]),
            )
            for case in self.cases
        ]


def histograms(num_runs: int = RUNS, num_particles: int = PARTICLES) -> Section:
    """Integral and sampled histograms against the usual OpenCV loop."""
    frame, boxes = problems.frame_with_boxes(OBJECTS)
    centres = jnp.asarray([(x + w / 2, y + h / 2, 1.0) for x, y, w, h in boxes], jnp.float32)
    noise = np.random.default_rng(2).normal(size=(num_runs, 3, num_particles))
    offsets = jnp.asarray(noise * [[4], [4], [0.02]], jnp.float32)
    cases = []
    for method in ("integral", "sampled"):
        likelihood = histogram(frame, boxes, method=method)

        @jax.jit
        def stages(observation: Any, likelihood: Any = likelihood) -> Any:
            # As in the filter: one stage after another, so that memory is reused.
            def stage(j, total):
                partition = jnp.full(num_particles, j, jnp.int32)
                every = jax.vmap(likelihood.log_prob_all, in_axes=(None, None, 0))
                return total + every(observation, partition, centres[j][:, None] + offsets)

            return lax.fori_loop(0, OBJECTS, stage, jnp.zeros((num_runs, num_particles)))

        run = partial(stages, jax.jit(likelihood.observe)(frame))
        cases.append(Case(f"histogram, {method}", run, num_runs * num_particles * OBJECTS))
    loop = rivals.opencv_loop(frame, boxes[0])
    cases.append(Case("OpenCV, a loop in Python", loop, rivals.LOOPED, cases[0].what, ">= 100"))
    return Section("Histogram likelihood, the frame's table excluded", cases)


def kernel(num_frames: int = 24) -> Section:
    """Every ordering against PS, and the usual OpenCV loop against DPS, on all devices."""
    frame, boxes = problems.frame_with_boxes(OBJECTS)
    frames = jnp.stack([jnp.asarray(frame)] * num_frames)
    likelihood = histogram(frame, boxes, method="integral")
    chosen = {
        "SIR": (orderings.sir(OBJECTS), ""),
        "PS": (orderings.ps(range(OBJECTS)), ""),
        "DPS": (orderings.dps(OBJECTS), ""),
        "SPS": (orderings.sps(num_partitions=OBJECTS), "<= 1.10"),
    }
    cases = []
    for name, (order, goal) in chosen.items():
        tracker = problems.box_tracker(likelihood, boxes, order, PARTICLES)
        cases.append(_case(f"whole kernel, {name}", tracker, frames, "whole kernel, PS", goal))
    loop = rivals.opencv_loop(frame, boxes[0])
    name = "OpenCV, one likelihood alone"
    cases.append(Case(name, loop, rivals.LOOPED, "whole kernel, DPS", ">= 24"))
    return Section("Whole kernel: 50 runs, 300 particles, 7 objects, 360x288", cases)


def _case(what: str, tracker: Any, frames: Any, baseline: str, goal: str) -> Case:
    """All runs of a tracker over all frames."""
    run = partial(jaxpf.monte_carlo, tracker, _keys(), frames, _record)
    units = RUNS * tracker.num_particles * tracker.num_partitions * len(frames)
    return Case(what, run, units, baseline, goal)


def _record(state: Any, summary: Any) -> Any:
    return summary.estimate, summary.log_evidence, summary.ess


def frame_sizes(
    shapes: Sequence[tuple[int, int]] = ((480, 640), (1080, 1920), (2160, 3840)),
    num_frames: int = 6,
) -> Section:
    """The default tracker of three objects of 32 pixels: large frames against small ones."""
    names = [f"{width}x{height}: a frame" for height, width in shapes]
    cases: list[Case] = []
    for name, shape in zip(names, shapes, strict=True):
        frame, boxes = problems.frame_with_boxes(3, *shape, size=(32, 32))
        frames = jnp.stack([jnp.asarray(frame)] * num_frames)
        tracker = jaxpf.boxes.tracker(frame, boxes)
        run = partial(jaxpf.run, tracker, jax.random.key(0), frames, _record)
        about = (names[0], "<= 2") if cases else ("", "")
        cases.append(Case(name, run, num_frames, *about))
    return Section("Frame sizes: learned appearance, 3 objects of 32 pixels, one run", cases)


@pytree_dataclass
class _UserDynamics:
    """Dynamics of the 1-D model as a user would write them."""

    def propagate(self, key, partition, current, previous, parent):
        return 0.9 * current + jax.random.normal(key, current.shape, current.dtype)


@pytree_dataclass
class _UserLikelihood:
    """Likelihood of the 1-D model as a user would write it."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[0, 0] - substate[0]) ** 2 - 0.5 * jnp.log(2 * jnp.pi)


def generic(num_particles: int = 1000, num_frames: int = 50) -> Section:
    """The generic kernel, with built-in and user-written models, against a minimal filter."""
    noise = np.random.default_rng(0).normal(size=(num_frames, 1, 1))
    frames, keys = jnp.asarray(noise, jnp.float32), _keys()
    minimal = jax.jit(
        jax.vmap(lambda key: rivals.minimal_filter(key, frames[:, 0, 0], num_particles))
    )
    built_in = problems.line_tracker(num_particles)
    own = dataclasses.replace(built_in, dynamics=_UserDynamics(), likelihood=_UserLikelihood())
    name = "filter written by hand"
    cases = [
        Case(name, lambda: minimal(keys), RUNS * num_particles * num_frames),
        _case("built-in model", built_in, frames, name, "<= 1.5"),
        _case("user-written model", own, frames, name, "<= 2"),
    ]
    return Section("1-D model, 50 runs, 1000 particles", cases)


#: Sections in the order of measurement.
SECTIONS = (histograms, kernel, frame_sizes, generic)


def _keys() -> jax.Array:
    return jax.random.split(jax.random.key(0), RUNS)
