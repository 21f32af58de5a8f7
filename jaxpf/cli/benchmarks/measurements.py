"""Sections of ``jaxpf bench``; each lists cases to time and their baselines."""

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
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
from jaxpf.likelihoods.windows import windows
from jaxpf.measures.timing import interleaved, median_interval

RUNS, PARTICLES, OBJECTS = 50, 300, problems.OBJECTS


class Case(NamedTuple):
    """A case to time.

    Attributes:
        what: name.
        run: computes the case once.
        units: particles times partitions times frames of one call; times are divided by it.
        baseline: name of the case to compare with; "" for none.
        of: description of the ratio.
        goal: this project's target for the ratio or the time.
        inverse: whether the ratio is the baseline's time over this case's time.
    """

    what: str
    run: Callable[[], Any]
    units: float
    baseline: str = ""
    of: str = ""
    goal: str = ""
    inverse: bool = False


class Row(NamedTuple):
    """A row of the table.

    Attributes:
        what: name of the case.
        nanoseconds: median per unit.
        ratio: median ratio of interleaved pairs.
        low, high: 95 % interval of the ratio (order statistics of the pairs).
        of: description of the ratio.
        goal: target for the ratio or the time.
    """

    what: str
    nanoseconds: float
    ratio: float
    low: float
    high: float
    of: str
    goal: str


class Section(NamedTuple):
    """Cases that are timed alternately; ``clock`` returns the time in seconds."""

    title: str
    cases: list[Case]
    clock: Callable[[], float] = time.perf_counter

    def rows(self, repeats: int) -> Iterator[Row]:
        """Time every case ``repeats`` times."""
        runs = {case.what: case.run for case in self.cases}
        seconds = interleaved(runs, repeats, self.clock)
        each = {case.what: seconds[case.what] / case.units for case in self.cases}
        for case in self.cases:
            yield row(case, each[case.what], each.get(case.baseline, each[case.what]))


def row(case: Case, seconds: np.ndarray, baseline: np.ndarray) -> Row:
    """Build a case's row from seconds per unit ``[repeats]`` of the case and of its baseline."""
    ratios = baseline / seconds if case.inverse else seconds / baseline
    return Row(
        case.what, 1e9 * float(np.median(seconds)), *median_interval(ratios), case.of, case.goal
    )


def histograms(num_runs: int = RUNS, num_particles: int = PARTICLES) -> Section:
    """Integral and sampled histograms against the usual OpenCV loop."""
    frame, boxes = problems.crowded_frame()
    centres = jnp.asarray([(x + w / 2, y + h / 2, 1.0) for x, y, w, h in boxes], jnp.float32)
    noise = np.random.default_rng(2).normal(size=(num_runs, 3, num_particles))
    offsets = jnp.asarray(noise * [[4], [4], [0.02]], jnp.float32)
    loop = "OpenCV, a loop in Python"
    cases = [Case(loop, rivals.opencv_loop(frame, boxes[0]), rivals.LOOPED)]
    for method, goal in (("integral", ">= 100"), ("sampled", "")):
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
        units = num_runs * num_particles * OBJECTS
        cases.append(Case(f"histogram, {method}", run, units, loop, "OpenCV / this", goal, True))
    return Section("Histogram likelihood (table excluded)", cases)


def contours() -> Section:
    """One contour hypothesis, without the frame's gradient."""
    likelihood, frame, substates = rivals.contour_problem()
    hypothesis = rivals.opencv_hypothesis(likelihood, frame)
    looped = substates.T[:200]

    def loop() -> None:
        for substate in looped:
            hypothesis(substate)

    observation = jax.jit(likelihood.observe)(frame)
    count = substates.shape[1]
    partition = jnp.zeros(count, jnp.int32)
    run = partial(jax.jit(likelihood.log_prob_all), observation, partition, jnp.asarray(substates))
    usual = "OpenCV's remap and NumPy, a loop"
    return Section(
        f"Contour likelihood: {rivals.LINES} lines of {rivals.SAMPLES} samples (gradient excluded; "
        "per hypothesis)",
        [
            Case(usual, loop, len(looped)),
            Case("contour likelihood", run, count, usual, "OpenCV / this", ">= 2.5", True),
        ],
    )


def kernel(num_frames: int = 24) -> Section:
    """Every ordering against PS, and the usual OpenCV loop against DPS, on all devices."""
    frame, boxes = problems.crowded_frame()
    likelihood = histogram(frame, boxes, method="integral")
    frames, keys = jnp.stack([jnp.asarray(frame)] * num_frames), _keys(RUNS)
    devices, units = jax.local_devices(), RUNS * PARTICLES * OBJECTS * num_frames
    chosen = {
        "SIR": (orderings.sir(OBJECTS), ""),
        "PS": (orderings.ps(range(OBJECTS)), "<= 300 ns"),
        "DPS": (orderings.dps(OBJECTS), "<= 300 ns"),
        "SPS": (orderings.sps(num_partitions=OBJECTS), "<= 1.10"),
    }

    def runs(ordering: Any, devices: Any = None) -> Callable[[], Any]:
        tracker = problems.box_tracker(likelihood, boxes, ordering, PARTICLES)
        keep = problems.keep_estimate
        return partial(jaxpf.monte_carlo, tracker, keys, frames, keep, devices=devices)

    cases = [
        Case(f"whole kernel, {name}", runs(order), units, "whole kernel, PS", "this / PS", goal)
        for name, (order, goal) in chosen.items()
    ]
    dps, of = "whole kernel, DPS", "this / DPS"
    if len(devices) > 1:
        name = f"the same on one device of {len(devices)}"
        cases.append(Case(name, runs(chosen["DPS"][0], devices[:1]), units, dps, of, ">= 1.3"))
    # The goal is 300 ns where OpenCV takes 7100 ns, or 24 times less on any machine.
    loop = rivals.opencv_loop(frame, boxes[0])
    cases.append(Case("OpenCV, one likelihood alone", loop, rivals.LOOPED, dps, of, ">= 24"))
    return Section("Whole kernel: 50 runs, 300 particles, 7 objects, 360x288", cases)


def appearance(
    num_runs: int = RUNS, num_particles: int = PARTICLES, num_frames: int = 12
) -> Section:
    """Learned appearance against colour: many runs, and one run on larger frames."""
    cases = []
    for what, (frame, boxes), runs in (
        (f"{num_runs} runs, 7 objects, 360x288", problems.crowded_frame(), num_runs),
        ("1 run, 5 objects, 640x480", problems.large_frame(), 1),
    ):
        frames, keys = jnp.stack([jnp.asarray(frame)] * num_frames), _keys(runs)
        colour = histogram(frame, boxes, num_particles=num_particles)
        usual = f"{what}: colour, {colour.method}"
        for name, likelihood, about in (
            (usual, colour, ("", "", "")),
            (f"{what}: learned", discriminative(frame, boxes), (usual, "this / colour", "<= 2")),
        ):
            order = orderings.ps(range(len(boxes)))
            tracker = problems.box_tracker(likelihood, boxes, order, num_particles)
            keep = problems.keep_estimate
            run = partial(jaxpf.monte_carlo, tracker, keys, frames, keep, min(runs, 25))
            cases.append(Case(name, run, runs * num_particles * len(boxes) * num_frames, *about))
    return Section(f"Learned appearance: whole kernel, {num_particles} particles", cases)


def frame_sizes(
    shapes: Sequence[tuple[int, int]] = ((480, 640), (1080, 1920), (2160, 3840)),
    num_frames: int = 6,
) -> Section:
    """The default tracker of three objects of 32 pixels: large frames against small ones."""
    names = [f"{width}x{height}: a frame" for height, width in shapes]
    cases: list[Case] = []
    for name, shape in zip(names, shapes, strict=True):
        frame, boxes = problems.small_objects(*shape)
        frames, tracker = (
            jnp.stack([jnp.asarray(frame)] * num_frames),
            jaxpf.boxes.tracker(frame, boxes),
        )
        run = partial(jaxpf.run, tracker, jax.random.key(0), frames, problems.keep_estimate)
        about = (names[0], f"this / {names[0]}", "<= 2") if cases else ("", "", "")
        cases.append(Case(name, run, num_frames, *about))
    return Section("Frame sizes: learned appearance, 3 objects of 32 pixels, one run", cases)


def labelled(num_particles: int = 2100, num_runs: int = 10, num_frames: int = 8) -> Section:
    """Seven labelled boxes against one box with the same likelihood and number of particles."""
    frame, boxes = problems.crowded_frame()
    frames, keys = jnp.stack([jnp.asarray(frame)] * num_frames), _keys(num_runs)
    likelihood = histogram(frame, boxes, method="integral")
    model = box_model(likelihood, boxes, problems.BOX_SCALE)
    plain = Options(particles=num_particles)
    fed_back = dataclasses.replace(plain, feedback="estimate", regularise=(0.9, 0.5))
    sir = problems.box_tracker(likelihood, boxes[:1], orderings.sir(1), num_particles)
    one, of, goal = "SIR, one box", "this / SIR", "<= 1.5"
    device, keep = jax.local_devices()[:1], problems.keep_estimate
    units = num_runs * num_particles * num_frames
    cases = [
        Case(
            name,
            partial(jaxpf.monte_carlo, tracker, keys, frames, keep, num_runs, device),
            units,
            one,
            of,
            "" if name == one else goal,
        )
        for name, tracker in (
            (one, sir),
            ("labelled, 7 boxes", LABELLED.tracker(model, plain)),
            ("the same, feedback", LABELLED.tracker(model, fed_back)),
        )
    ]
    title = f"Labelled particles: {num_runs} runs, {num_particles} particles; CPU time, one device"
    return Section(title, cases, time.process_time)


@pytree_dataclass
class _OneParticleDynamics:
    """Dynamics of the 1-D model as a user would write them."""

    def propagate(self, key, partition, current, previous, parent):
        return 0.9 * current + jax.random.normal(key, current.shape, current.dtype)


@pytree_dataclass
class _OneParticleLikelihood:
    """Likelihood of the 1-D model as a user would write it."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[0, 0] - substate[0]) ** 2 - 0.5 * jnp.log(2 * jnp.pi)


def generic(num_particles: int = 1000, num_frames: int = 50) -> Section:
    """The generic kernel, with built-in and user-defined models, against a minimal filter."""
    frames, keys = _line(num_frames), _keys(RUNS)
    minimal = jax.jit(
        jax.vmap(lambda key: rivals.minimal_filter(key, frames[:, 0, 0], num_particles))
    )
    built_in = problems.line_tracker(num_particles)
    own = dataclasses.replace(
        built_in, dynamics=_OneParticleDynamics(), likelihood=_OneParticleLikelihood()
    )
    units, name = RUNS * num_particles * num_frames, "minimal filter, 1-D"
    cases = [Case(name, lambda: minimal(keys), units)]
    for what, tracker, goal in (
        ("generic kernel, built-in parts", built_in, "<= 1.5"),
        ("generic kernel, user's own parts", own, "<= 2"),
    ):
        run = partial(jaxpf.monte_carlo, tracker, keys, frames, problems.keep_report, RUNS)
        cases.append(Case(what, run, units, name, "this / minimal", goal))
    return Section("Generic kernel: 1-D model, 50 runs, 1000 particles", cases)


def points(height: int = 1080, width: int = 1920, num_frames: int = 8, count: int = 12) -> Section:
    """A window and a whole frame of each point filter, without decoding."""
    rng = np.random.default_rng(0)
    stack = rng.integers(0, 256, (num_frames + 1, height, width, 3), dtype=np.uint8)
    middle, num_windows = np.array([width, height]) / 2, 480
    places = (middle + rng.uniform(-0.2, 0.2, (count, 2)) * height).astype(np.float32)
    frames, key = jnp.asarray(stack[1:]), jax.random.key(0)
    likelihood = windows(stack[0], places)
    near = np.repeat(places, num_windows // count, axis=0) + rng.normal(0, 10, (num_windows, 2))
    partition = jnp.repeat(jnp.arange(count), num_windows // count)
    weigh = jax.jit(likelihood.log_prob_all)
    window = partial(weigh, frames[0], partition, jnp.asarray(near.T, jnp.float32))
    make = partial(jaxpf.points.tracker, stack[0], places, diffusion=10.0)
    pffl, of, goal = "PFFL, M = 50: a frame", "this / PFFL", "3.3e6 ns or less"
    cases = [Case("one window of 21 x 21", window, num_windows, goal="<= 2800 ns")]
    for what, tracker, limit in (
        ("eskil2014, M = 10, each moved once: a frame", make(upsampling=1), goal),
        ("eskil2014, M = 10, each moved three times: a frame", make(), goal),
        (pffl, make(method="pffl"), "6.7e6 ns or less"),
    ):
        run = partial(jaxpf.run, tracker, key, frames)
        cases.append(Case(what, run, num_frames, pffl, of, limit))
    return Section(f"Points: {count}, {height}x{width}, one run; decoding excluded", cases)


def gradients(num_particles: int = 1000, num_frames: int = 50, num_runs: int = 10) -> Section:
    """Value and gradient against the value alone; the backward pass recomputes every frame."""
    line, (frame, boxes) = _line(num_frames), problems.crowded_frame()
    boxes = boxes[:3]
    boxed = problems.box_tracker(
        histogram(frame, boxes, method="integral"),
        boxes,
        orderings.dps(3),
        max(num_particles // 3, 3),
        gradient=StopGradient(),
        motion_gradient="score",
    )
    stopped = problems.line_tracker(num_particles, gradient=StopGradient())
    video = jnp.stack([jnp.asarray(frame)] * max(num_frames // 6, 1))
    value = jax.jit(problems.mean_evidence)
    both = jax.jit(jax.value_and_grad(problems.mean_evidence, allow_int=True))
    keys, cases = _keys(num_runs), []

    def of_motion(tracker: Any, frames: Any) -> Any:
        # Derivatives of integers cannot be waited for.
        evidence, gradient = both(tracker, keys, frames)
        return evidence, jax.tree.leaves(gradient.dynamics)[0]

    for name, tracker, frames, num_partitions in (
        ("1-D, none", problems.line_tracker(num_particles), line, 1),
        ("1-D, stop_gradient", stopped, line, 1),
        ("3 boxes, stop_gradient", boxed, video, 3),
    ):
        units = num_runs * tracker.num_particles * num_partitions * len(frames)
        alone = f"{name}: value"
        cases.append(Case(alone, partial(value, tracker, keys, frames), units))
        run = partial(of_motion, tracker, frames)
        cases.append(Case(f"{name}: with gradient", run, units, alone, "this / value", "<= 4"))
    return Section(f"Gradient of the evidence: {num_runs} runs", cases)


#: Sections in the order of measurement.
SECTIONS = (
    histograms,
    contours,
    kernel,
    appearance,
    frame_sizes,
    labelled,
    generic,
    points,
    gradients,
)


def turned_parts(repeats: int) -> Iterator[Row]:
    """CPU time of PS and SPS on gonzales2011's largest articulated object, all runs batched."""
    from jaxpf.papers.gonzales2011 import times
    from jaxpf.papers.gonzales2011.published import FRAMES, RUNS as PUBLISHED_RUNS

    parts, particles = times.LARGEST
    seconds = times.measure_times((parts,), (particles,), 10, repeats, PUBLISHED_RUNS)
    each = {n: s / (parts * particles * FRAMES) for n, s in seconds[times.LARGEST].items()}
    goals = {"PS": f"<= {times.GOAL} ns", "SPS combinatorial": f"<= {times.AT_MOST}"}
    for method in times.METHODS:
        case = Case(f"{parts} parts, {method}", lambda: None, 1, "PS", "this / PS")
        yield row(case._replace(goal=goals.get(method, "")), each[method], each["PS"])


def _keys(count: int) -> jax.Array:
    return jax.random.split(jax.random.key(0), count)


def _line(num_frames: int) -> jax.Array:
    return jnp.asarray(np.random.default_rng(0).normal(size=(num_frames, 1, 1)), jnp.float32)
