"""What things cost, each beside a baseline measured in the same minute.

The unit is nanoseconds per particle, partition and frame, everything included but
compilation.  Baseline and candidate are timed alternately and the median of their ratios
is reported: on a shared machine ratios can be trusted, figures hardly.
"""

import dataclasses
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import jaxpf
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.models.dynamics import LinearGaussian
from jaxpf.models.likelihoods.gaussian import Gaussian
from jaxpf.models.likelihoods.histogram import histogram
from jaxpf.pytree import pytree_dataclass
from jaxpf.running import init
from jaxpf.targets.boxes import box_tracker

RUNS, PARTICLES, OBJECTS, HEIGHT, WIDTH = 50, 300, 7, 288, 360


class Row(NamedTuple):
    """One line of the table.

    Attributes:
        what: the thing measured.
        nanoseconds: median, per particle, partition and frame.
        ratio: median of the interleaved pairs' ratios, its sense told by ``of``.
        low: lower end of the ratio's 95 % interval (order statistics of the pairs).
        high: upper end.
        of: what the ratio compares.
        goal: what is asked of the ratio or the figure.
    """

    what: str
    nanoseconds: float
    ratio: float
    low: float
    high: float
    of: str
    goal: str


def interleaved(
    candidates: Mapping[str, Callable[[], Any]],
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, np.ndarray]:
    """Seconds of every candidate, ``[repeats]``, timed in turn after one warm-up."""
    for candidate in candidates.values():
        jax.block_until_ready(candidate())
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for repeat in range(repeats):
        names = list(candidates)
        for name in names if repeat % 2 == 0 else reversed(names):
            began = clock()
            jax.block_until_ready(candidates[name]())
            seconds[name].append(clock() - began)
    return {name: np.array(values) for name, values in seconds.items()}


def median_interval(values: np.ndarray) -> tuple[float, float, float]:
    """Median and its 95 % interval from order statistics (a sign test turned round)."""
    ordered = np.sort(values)
    n = len(ordered)
    reach = int(np.floor(0.5 * n - 0.98 * np.sqrt(n))) - 1
    reach = min(max(reach, 0), (n - 1) // 2)
    return float(np.median(ordered)), float(ordered[reach]), float(ordered[n - 1 - reach])


def compared(
    what: str, seconds: np.ndarray, units: float, baseline: np.ndarray, of: str, goal: str
) -> Row:
    """A row whose ratio is ``seconds`` over ``baseline`` (both ``[repeats]``)."""
    median, low, high = median_interval(seconds / baseline)
    return Row(what, float(np.median(seconds)) / units * 1e9, median, low, high, of, goal)


# --- Histogram likelihood -----------------------------------------------------------------


def crowded_frame(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A frame of noise with 7 objects of a dozen colours each, and their boxes ``[P, 4]``."""
    rng = np.random.default_rng(seed)
    frame = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    boxes = []
    for i in range(OBJECTS):
        x, y = 20 + 45 * i, 30 + 28 * i
        colours = rng.integers(0, 256, (12, 3))
        frame[y : y + 42, x : x + 32] = colours[rng.integers(0, 12, (42, 32))]
        boxes.append((x, y, 32, 42))
    return frame, np.array(boxes, float)


def opencv_loop(frame: np.ndarray, box: np.ndarray, count: int = 300) -> Callable[[], None]:
    """The usual way: calcHist and compareHist for one particle after the other.

    One hue-saturation histogram of 110 bins and no parts: less work than ours does.
    """
    import cv2

    cv2.setNumThreads(1)
    hsv = cv2.cvtColor(frame, cv2.COLOR_RGB2HSV)
    x, y, w, h = (round(value) for value in box)
    offsets = np.random.default_rng(1).normal(0, 4, (count, 2)).round().astype(int)

    def counted(left: int, top: int) -> np.ndarray:
        window = hsv[max(top, 0) : top + h, max(left, 0) : left + w]
        return cv2.calcHist([window], [0, 1], None, [11, 10], [0, 180, 0, 256])

    reference = counted(x, y)

    def loop() -> None:
        for right, down in offsets:
            counts = counted(x + right, y + down)
            np.exp(-20 * cv2.compareHist(reference, counts, cv2.HISTCMP_BHATTACHARYYA) ** 2)

    return loop


def histogram_rows(repeats: int) -> Iterator[Row]:
    """Integral and sampled histograms against the OpenCV loop; the table is not included."""
    frame, boxes = crowded_frame()
    centres = jnp.asarray([(x + w / 2, y + h / 2, 1.0) for x, y, w, h in boxes], jnp.float32)
    offsets = np.random.default_rng(2).normal(size=(RUNS, 3, PARTICLES)) * [[4], [4], [0.02]]
    noise = jnp.asarray(offsets, jnp.float32)
    candidates: dict[str, Callable[[], Any]] = {"opencv": opencv_loop(frame, boxes[0])}
    for method in ("integral", "sampled"):
        likelihood = histogram(frame, boxes, method=method)
        observation = jax.jit(likelihood.observe)(frame)

        @jax.jit
        def stages(observation, likelihood=likelihood):
            # As in the filter: stage after stage, so that memory is reused.
            def stage(j, total):
                partition = jnp.full(PARTICLES, j, jnp.int32)
                every = jax.vmap(likelihood.log_prob_all, in_axes=(None, None, 0))
                return total + every(observation, partition, centres[j][:, None] + noise)

            return lax.fori_loop(0, OBJECTS, stage, jnp.zeros((RUNS, PARTICLES)))

        candidates[method] = partial(stages, observation)
    seconds = interleaved(candidates, repeats)
    loop = seconds["opencv"] / 300
    yield Row("OpenCV, a loop in Python", float(np.median(loop)) * 1e9, 1, 1, 1, "", "")
    queries = RUNS * PARTICLES * OBJECTS
    for method in ("integral", "sampled"):
        goal = ">= 100" if method == "integral" else ""
        ratio = median_interval(loop / (seconds[method] / queries))
        nanoseconds = float(np.median(seconds[method])) / queries * 1e9
        yield Row(f"histogram, {method}", nanoseconds, *ratio, "OpenCV / this", goal)


# --- The whole kernel ---------------------------------------------------------------------


def keep_estimate(state: Any, summary: Any) -> Any:
    """What an evaluation needs of a frame."""
    return summary.estimate, summary.log_evidence, summary.ess, summary.uniqueness


def kernel_rows(repeats: int, num_frames: int = 24) -> Iterator[Row]:
    """PS, DPS and SPS on smith2004's sizes, the histogram table included, on all devices."""
    frame, boxes = crowded_frame()
    likelihood = histogram(frame, boxes, method="integral")
    frames = jnp.stack([jnp.asarray(frame)] * num_frames)
    keys = jax.random.split(jax.random.key(0), RUNS)
    chosen = {
        "SIR": orderings.sir(OBJECTS),
        "PS": orderings.ps(range(OBJECTS)),
        "DPS": orderings.dps(OBJECTS),
        "SPS": orderings.sps(num_partitions=OBJECTS),
    }
    devices = jax.local_devices()

    def candidate(ordering: Any, devices: Any = None) -> Callable[[], Any]:
        tracker = box_tracker(
            likelihood, boxes, ordering, scale=(2, 2, 0.001), num_particles=PARTICLES
        )
        return partial(jaxpf.monte_carlo, tracker, keys, frames, keep_estimate, devices=devices)

    candidates: dict[str, Callable[[], Any]] = {n: candidate(o) for n, o in chosen.items()}
    if len(devices) > 1:
        candidates["one device"] = candidate(chosen["DPS"], devices[:1])
    candidates["opencv"] = opencv_loop(frame, boxes[0])
    seconds = interleaved(candidates, repeats)
    units = RUNS * PARTICLES * OBJECTS * num_frames
    for name in chosen:
        goal = {"SPS": "<= 1.10", "SIR": ""}.get(name, "<= 300 ns")
        yield compared(
            f"whole kernel, {name}", seconds[name], units, seconds["PS"], "this / PS", goal
        )
    if len(devices) > 1:
        name = f"the same on one device of {len(devices)}"
        yield compared(name, seconds["one device"], units, seconds["DPS"], "this / DPS", ">= 1.3")
    # 300 ns were asked for on a machine where OpenCV takes 7100: on any machine, 24 times less.
    loop = seconds["opencv"] / 300
    ratio = median_interval(loop / (seconds["DPS"] / units))
    nanoseconds = float(np.median(loop)) * 1e9
    yield Row("OpenCV, one likelihood alone", nanoseconds, *ratio, "this / DPS", ">= 24")


# --- One dimension, one partition, against a minimal filter -------------------------------


@pytree_dataclass
class _OneParticleDynamics:
    """What a user would write for the 1-D model."""

    def propagate(self, key, partition, current, previous, parent):
        return 0.9 * current + jax.random.normal(key, current.shape, current.dtype)


@pytree_dataclass
class _OneParticleLikelihood:
    """What a user would write for the 1-D model."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[0, 0] - substate[0]) ** 2 - 0.5 * jnp.log(2 * jnp.pi)


def minimal_filter(key: jax.Array, frames: jax.Array, num_particles: int) -> Any:
    """A bootstrap filter for one linear-Gaussian model, and nothing but that."""

    def step(carry, item):
        x, log_weights = carry
        time_, y = item
        resample_key, noise_key = jax.random.split(jax.random.fold_in(key, time_))
        weights = jnp.exp(log_weights - jnp.max(log_weights))
        total = lax.scan(lambda c, w: (c + w, c + w), jnp.zeros(()), weights)[1]
        offset = jax.random.uniform(resample_key)
        ends = jnp.ceil(num_particles * total / total[-1] - offset).astype(jnp.int32)
        counts = jnp.zeros(num_particles + 1, jnp.int32).at[ends].add(1, mode="drop")
        ancestors = lax.scan(
            lambda c, n: (c + n, c + n), jnp.zeros((), jnp.int32), counts[:num_particles]
        )[1]
        x = 0.9 * x[ancestors] + jax.random.normal(noise_key, (num_particles,))
        log_weights = -0.5 * (y - x) ** 2 - 0.5 * jnp.log(2 * jnp.pi)
        largest = jnp.max(log_weights)
        weights = jnp.exp(log_weights - largest)
        sum_ = jnp.sum(weights)
        report = (
            largest + jnp.log(sum_ / num_particles),
            jnp.sum(weights * x) / sum_,
            sum_**2 / jnp.sum(weights**2),
        )
        return (x, log_weights), report

    start = jnp.zeros(num_particles), jnp.zeros(num_particles)
    return lax.scan(step, start, (jnp.arange(frames.shape[0]), frames))[1]


def line_tracker(
    num_particles: int, num_partitions: int = 1, gradient: str = "none"
) -> jaxpf.Partitioned:
    """``minimal_filter``'s model in the generic kernel, once for every partition."""
    one = jnp.ones((num_partitions, 1, 1))
    return jaxpf.Partitioned(
        dynamics=LinearGaussian(transition=0.9 * one, noise=one),
        likelihood=Gaussian(noise=one),
        ordering=orderings.ps(range(num_partitions)),
        initial=jnp.zeros((num_partitions, 1)),
        num_particles=num_particles,
        gradient=gradient,
    )


def keep_report(state: Any, summary: Any) -> Any:
    """What ``minimal_filter`` reports."""
    return summary.log_evidence, summary.estimate, summary.ess


def generic_rows(repeats: int, num_particles: int = 1000, num_frames: int = 50) -> Iterator[Row]:
    """The generic kernel with P = 1 against a filter written for the model."""
    frames = jnp.asarray(
        np.random.default_rng(0).normal(size=(num_frames, 1, 1)), dtype=jnp.float32
    )
    keys = jax.random.split(jax.random.key(0), RUNS)
    minimal = jax.jit(jax.vmap(lambda key: minimal_filter(key, frames[:, 0, 0], num_particles)))
    built_in = line_tracker(num_particles)
    own = dataclasses.replace(
        built_in, dynamics=_OneParticleDynamics(), likelihood=_OneParticleLikelihood()
    )
    trackers = {
        "generic kernel, built-in parts": built_in,
        "generic kernel, user's own parts": own,
    }
    candidates: dict[str, Callable[[], Any]] = {"minimal": lambda: minimal(keys)}
    for name, tracker in trackers.items():
        candidates[name] = partial(jaxpf.monte_carlo, tracker, keys, frames, keep_report, RUNS)
    seconds = interleaved(candidates, repeats)
    units = RUNS * num_particles * num_frames
    yield compared("minimal filter, 1-D", seconds["minimal"], units, seconds["minimal"], "", "")
    for name, goal in zip(trackers, ("<= 1.5", "<= 2"), strict=True):
        yield compared(name, seconds[name], units, seconds["minimal"], "this / minimal", goal)


# --- A cold start, and memory --------------------------------------------------------------

_COLD_START = """
from jaxpf.cli.common import start_jax
start_jax()
from jaxpf.experiments.smith2004.synthetic import RUNS_PER_SCENE, all_orderings, measure
from jaxpf.experiments.smith2004.published import RUNS
chosen = {n: o for n, o in all_orderings().items() if n not in ("DPS evidence", "SPS")}
measure(range(RUNS // RUNS_PER_SCENE), orderings=chosen)
"""


def cold_reproduction() -> float:
    """Seconds for smith2004's tables 1 and 2 in a new process without any compiled kernel.

    4 values of sharpness x (50 runs of Non-PS, 7 x 50 of PS, 50 of DPS): 1800 runs.
    """
    with tempfile.TemporaryDirectory() as empty:
        environment = os.environ | {"JAXPF_CACHE_DIR": empty}
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", _COLD_START], env=environment, check=True)
        return time.perf_counter() - began


def memory_rows(frames: Sequence[int] = (10, 100, 1000)) -> Iterator[tuple[int, int]]:
    """Bytes that a run over T frames needs beyond its input and output, for several T."""
    tracker = line_tracker(10_000)

    def track(key, observed):
        def step(state, item):
            state, summary = tracker.step(jax.random.fold_in(key, item[0]), state, item[1])
            return state, summary.log_evidence

        times = jnp.arange(observed.shape[0])
        return lax.scan(step, init(tracker, key), (times, observed))[1]

    for num_frames in frames:
        compiled = jax.jit(track).lower(jax.random.key(0), jnp.zeros((num_frames, 1, 1))).compile()
        analysis: Any = compiled.memory_analysis()
        yield num_frames, int(analysis.temp_size_in_bytes)
