"""Sections of ``jaxpf bench``; each lists cases to time and their baselines."""

import dataclasses
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.boxes.models import box_model
from jaxpf.cli.benchmarks import problems, rivals
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.filters.labelled.options import LABELLED, Options
from jaxpf.gradients import StopGradient
from jaxpf.likelihoods.discriminative import discriminative
from jaxpf.likelihoods.histogram import histogram
from jaxpf.measures.timing import interleaved, median_interval
from jaxpf.tuning import objectives

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
    """Cases that are timed alternately; ``clock`` returns the time in seconds."""

    title: str
    cases: list[Case]
    clock: Callable[[], float] = time.perf_counter

    def measure(self, repeats: int) -> list[tuple[float, tuple[float, float, float]]]:
        """Median nanoseconds per unit of every case, and its ratio to the baseline's time.

        Ratios are medians of interleaved pairs with a 95 % interval; 1 without a baseline.
        """
        runs = {case.what: case.run for case in self.cases}
        seconds = interleaved(runs, repeats, self.clock)
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
    likelihood = histogram(frame, boxes, method="integral")
    chosen = {
        "SIR": (orderings.sir(OBJECTS), ""),
        "PS": (orderings.ps(range(OBJECTS)), ""),
        "DPS": (orderings.dps(OBJECTS), ""),
        "SPS": (orderings.sps(num_partitions=OBJECTS), "<= 1.10"),
    }
    cases = [
        _case(
            f"whole kernel, {name}",
            problems.box_tracker(likelihood, boxes, order, PARTICLES),
            [frame] * num_frames,
            "whole kernel, PS",
            goal,
        )
        for name, (order, goal) in chosen.items()
    ]
    loop = rivals.opencv_loop(frame, boxes[0])
    name = "OpenCV, one likelihood alone"
    cases.append(Case(name, loop, rivals.LOOPED, "whole kernel, DPS", ">= 24"))
    return Section("Whole kernel: 50 runs, 300 particles, 7 objects, 360x288", cases)


def _case(
    what: str,
    tracker: Any,
    frames: Any,
    baseline: str = "",
    goal: str = "",
    num_runs: int = RUNS,
    num_partitions: int = OBJECTS,
) -> Case:
    """All runs of a tracker over all frames."""
    frames, keys = jnp.stack([jnp.asarray(each) for each in frames]), _keys(num_runs)
    run = partial(jaxpf.monte_carlo, tracker, keys, frames, _record)
    units = num_runs * tracker.num_particles * num_partitions * len(frames)
    return Case(what, run, units, baseline, goal)


def _record(state: Any, summary: Any) -> Any:
    return summary.estimate, summary.log_evidence, summary.ess


def appearance(
    num_runs: int = RUNS, num_particles: int = PARTICLES, num_frames: int = 12
) -> Section:
    """Learned appearance against colour: many runs, and one run on larger frames."""
    cases = []
    for what, (frame, boxes), runs in (
        (f"{num_runs} runs, 7 objects, 360x288", problems.frame_with_boxes(OBJECTS), num_runs),
        ("1 run, 5 objects, 640x480", problems.frame_with_boxes(5, 480, 640, (60, 120)), 1),
    ):
        count, colour = len(boxes), histogram(frame, boxes, num_particles=num_particles)
        usual = f"{what}: colour, {colour.method}"
        for name, likelihood, about in (
            (usual, colour, ("", "")),
            (f"{what}: learned", discriminative(frame, boxes), (usual, "<= 2")),
        ):
            order = orderings.ps(range(count))
            tracker = problems.box_tracker(likelihood, boxes, order, num_particles)
            cases.append(_case(name, tracker, [frame] * num_frames, *about, runs, count))
    return Section(f"Learned appearance: whole kernel, {num_particles} particles", cases)


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


def labelled(num_particles: int = 2100, num_runs: int = 10, num_frames: int = 8) -> Section:
    """Seven labelled boxes against one box with the same likelihood and number of particles."""
    frame, boxes = problems.frame_with_boxes(OBJECTS)
    likelihood = histogram(frame, boxes, method="integral")
    model = box_model(likelihood, boxes, problems.BOX_SCALE)
    sir = problems.box_tracker(likelihood, boxes[:1], orderings.sir(1), num_particles)
    labels = LABELLED.tracker(model, Options(particles=num_particles))
    frames, name = [frame] * num_frames, "SIR, one box"
    cases = [
        _case(name, sir, frames, "", "", num_runs, 1),
        _case("labelled, 7 boxes", labels, frames, name, "<= 1.5", num_runs, 1),
    ]
    title = f"Labelled particles: {num_runs} runs, {num_particles} particles; CPU time"
    return Section(title, cases, time.process_time)


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
    frames, keys = _line(num_frames), _keys(RUNS)
    minimal = jax.jit(
        jax.vmap(lambda key: rivals.minimal_filter(key, frames[:, 0, 0], num_particles))
    )
    built_in = problems.line_tracker(num_particles)
    own = dataclasses.replace(built_in, dynamics=_UserDynamics(), likelihood=_UserLikelihood())
    name = "filter written by hand"
    cases = [
        Case(name, lambda: minimal(keys), RUNS * num_particles * num_frames),
        _case("built-in model", built_in, frames, name, "<= 1.5", num_partitions=1),
        _case("user-written model", own, frames, name, "<= 2", num_partitions=1),
    ]
    return Section("1-D model, 50 runs, 1000 particles", cases)


def gradients(num_particles: int = 1000, num_frames: int = 50, num_runs: int = 10) -> Section:
    """Value and gradient against the value alone; the backward pass recomputes every frame."""
    frames, keys, cases = _line(num_frames), _keys(num_runs), []

    def value(tracker: Any) -> Any:
        return jnp.mean(objectives.log_evidence(tracker, keys, frames))

    @jax.jit
    def both(tracker: Any) -> Any:
        # Derivatives of integers cannot be waited for.
        evidence, gradient = jax.value_and_grad(value, allow_int=True)(tracker)
        return evidence, jax.tree.leaves(gradient.dynamics)[0]

    units = num_runs * num_particles * num_frames
    for name, gradient in (("none", None), ("stop_gradient", StopGradient())):
        settings = {} if gradient is None else {"gradient": gradient}
        tracker = problems.line_tracker(num_particles, **settings)
        alone = f"{name}: value"
        cases.append(Case(alone, partial(jax.jit(value), tracker), units))
        cases.append(Case(f"{name}: with gradient", partial(both, tracker), units, alone, "<= 4"))
    return Section(f"Gradient of the evidence: 1-D model, {num_runs} runs", cases)


#: Sections in the order of measurement.
SECTIONS = (histograms, kernel, appearance, frame_sizes, labelled, generic, gradients)


def _keys(count: int) -> jax.Array:
    return jax.random.split(jax.random.key(0), count)


def _line(num_frames: int) -> jax.Array:
    return jnp.asarray(np.random.default_rng(0).normal(size=(num_frames, 1, 1)), jnp.float32)
