"""Speed on this machine, each figure beside its baseline: ``python tests/benchmarks/speed.py``.

ns: nanoseconds per particle, partition and frame, compilation excluded; the whole kernel includes
the histogram table.  Ratios to the baseline's time are medians of interleaved pairs with 95%
intervals (from six repeats on).  On a shared machine trust them more than the nanoseconds.
"""

import dataclasses
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.boxes.models import box_model
from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.startup import start_jax
from jaxpf.dynamics import LinearGaussian
from jaxpf.likelihoods import Gaussian, histogram
from jaxpf.measures import Interval, median_interval

RUNS, PARTICLES, OBJECTS = 50, 300, 7
#: Noise of x, y (pixels) and of the scale.
_BOX_SCALE = (2, 2, 0.001)


def interleaved(
    candidates: Mapping[str, Callable[[], object]], repeats: int
) -> dict[str, np.ndarray]:
    """Seconds ``[repeats]`` of each candidate, timed in turn after one warm-up."""
    for candidate in candidates.values():
        jax.block_until_ready(candidate())
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for repeat in range(repeats):
        names = list(candidates)
        for name in names if repeat % 2 == 0 else reversed(names):
            began = time.perf_counter()
            jax.block_until_ready(candidates[name]())
            seconds[name].append(time.perf_counter() - began)
    return {name: np.array(values) for name, values in seconds.items()}


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
    run: Callable[[], object]
    units: float
    baseline: str = ""
    goal: str = ""


class Section(NamedTuple):
    """Cases that are timed alternately."""

    title: str
    cases: list[Case]

    def measure(self, repeats: int) -> list[tuple[float, Interval]]:
        """Median nanoseconds per unit of every case, and its ratio to the baseline's time.

        Ratios are medians of interleaved pairs; 1 without a baseline.
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


def kernel(num_frames: int = 24) -> Section:
    """Every ordering against PS, and the usual OpenCV loop against DPS, on all devices."""
    frame, boxes = _frame_with_boxes(OBJECTS)
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
        model = box_model(likelihood, boxes, _BOX_SCALE)._asdict()
        tracker = jaxpf.Partitioned(**model, ordering=order, num_particles=PARTICLES)
        cases.append(_case(f"whole kernel, {name}", tracker, frames, "whole kernel, PS", goal))
    loop = opencv_loop(frame, boxes[0])
    name = "OpenCV, one likelihood alone"
    cases.append(Case(name, loop, LOOPED, "whole kernel, DPS", ">= 24"))
    return Section("Whole kernel: 50 runs, 300 particles, 7 objects, 360x288", cases)


def _case(
    what: str, tracker: jaxpf.Partitioned, frames: jax.Array, baseline: str, goal: str
) -> Case:
    """All runs of a tracker over all frames."""
    run = partial(jaxpf.monte_carlo, tracker, _keys(), frames, _record)
    units = RUNS * tracker.num_particles * tracker.num_partitions * len(frames)
    return Case(what, run, units, baseline, goal)


def _record(state: object, summary: jaxpf.Summary) -> tuple[jax.Array, ...]:
    return summary.estimate, summary.log_evidence, summary.ess


def frame_sizes(
    shapes: Sequence[tuple[int, int]] = ((480, 640), (1080, 1920), (2160, 3840)),
    num_frames: int = 6,
) -> Section:
    """The default tracker of three objects of 32 pixels: large frames against small ones."""
    names = [f"{width}x{height}: a frame" for height, width in shapes]
    cases: list[Case] = []
    for name, shape in zip(names, shapes, strict=True):
        frame, boxes = _frame_with_boxes(3, *shape, size=(32, 32))
        frames = jnp.stack([jnp.asarray(frame)] * num_frames)
        tracker = jaxpf.boxes.tracker(frame, boxes)
        run = partial(jaxpf.run, tracker, jax.random.key(0), frames, _record)
        about = (names[0], "<= 2") if cases else ("", "")
        cases.append(Case(name, run, num_frames, *about))
    return Section("Frame sizes: learned appearance, 3 objects of 32 pixels, one run", cases)


@jaxpf.pytree_dataclass
class _UserDynamics:
    """Dynamics of the 1-D model as a user would write them."""

    def propagate(self, key, partition, current, previous, parent):
        return 0.9 * current + jax.random.normal(key, current.shape, current.dtype)


@jaxpf.pytree_dataclass
class _UserLikelihood:
    """Likelihood of the 1-D model as a user would write it."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[0, 0] - substate[0]) ** 2 - 0.5 * jnp.log(2 * jnp.pi)


def generic(num_particles: int = 1000, num_frames: int = 50) -> Section:
    """The generic kernel, with built-in and user-written models, against a minimal filter.

    The model is ``x_t = .9 x_{t-1} + n``, observed with unit noise.
    """
    noise = np.random.default_rng(0).normal(size=(num_frames, 1, 1))
    frames, keys = jnp.asarray(noise, jnp.float32), _keys()
    minimal = jax.jit(jax.vmap(lambda key: minimal_filter(key, frames[:, 0, 0], num_particles)))
    unit = jnp.ones((1, 1, 1))
    built_in = jaxpf.Partitioned(
        dynamics=LinearGaussian(transition=0.9 * unit, noise=unit),
        likelihood=Gaussian(noise=unit),
        initial=jnp.zeros((1, 1)),
        ordering=orderings.sir(1),
        num_particles=num_particles,
    )
    own = dataclasses.replace(built_in, dynamics=_UserDynamics(), likelihood=_UserLikelihood())
    name = "filter written by hand"
    cases = [
        Case(name, lambda: minimal(keys), RUNS * num_particles * num_frames),
        _case("built-in model", built_in, frames, name, "<= 1.5"),
        _case("user-written model", own, frames, name, "<= 2"),
    ]
    return Section("1-D model, 50 runs, 1000 particles", cases)


def _frame_with_boxes(
    count: int, height: int = 288, width: int = 360, size: tuple[int, int] = (32, 42)
) -> tuple[np.ndarray, np.ndarray]:
    """A frame of noise with objects of a dozen colours each on its diagonal; their boxes."""
    rng = np.random.default_rng(0)
    frame = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    w, h = size
    step = np.array([width - w - 20, height - h - 30]) // count
    boxes = np.array([(20 + i * step[0], 30 + i * step[1], w, h) for i in range(count)])
    for x, y, _, _ in boxes:
        colours = rng.integers(0, 256, (12, 3))
        frame[y : y + h, x : x + w] = colours[rng.integers(0, 12, (h, w))]
    return frame, boxes.astype(float)


#: Particles per pass of ``opencv_loop``.
LOOPED = 300


def opencv_loop(frame: np.ndarray, box: np.ndarray) -> Callable[[], None]:
    """The usual loop: calcHist and compareHist, particle by particle.

    One hue-saturation histogram of 110 bins without body parts: less work than our likelihood does.
    """
    cv2.setNumThreads(1)
    hsv = cv2.cvtColor(frame, cv2.COLOR_RGB2HSV)
    x, y, w, h = (round(value) for value in box)
    offsets = np.random.default_rng(1).normal(0, 4, (LOOPED, 2)).round().astype(int)

    def histogram(left: int, top: int) -> np.ndarray:
        window = hsv[max(top, 0) : top + h, max(left, 0) : left + w]
        return cv2.calcHist([window], [0, 1], None, [11, 10], [0, 180, 0, 256])

    reference = histogram(x, y)

    def loop() -> None:
        for right, down in offsets:
            counts = histogram(x + right, y + down)
            np.exp(-20 * cv2.compareHist(reference, counts, cv2.HISTCMP_BHATTACHARYYA) ** 2)

    return loop


def minimal_filter(key: jax.Array, frames: jax.Array, num_particles: int) -> tuple[jax.Array, ...]:
    """A bootstrap filter written by hand for the model of ``generic``."""

    def step(carry, item):
        x, log_weights = carry
        time, y = item
        resample_key, noise_key = jax.random.split(jax.random.fold_in(key, time))
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


def _keys() -> jax.Array:
    return jax.random.split(jax.random.key(0), RUNS)


def main(repeats: int = 15) -> None:
    """Measure and print every section; ``repeats`` interleaved repeats."""
    start_jax()
    for make in (kernel, frame_sizes, generic):
        section = make()
        rows = []
        for case, (nanoseconds, ratio) in zip(section.cases, section.measure(repeats), strict=True):
            value, _, low, high = ratio
            ends = f"[{low:.2f}, {high:.2f}]" if low < high else ""
            shown = [f"{value:.2f}", ends] if case.baseline else ["", ""]
            rows.append([case.what, f"{nanoseconds:.1f}", *shown, case.baseline, case.goal])
        columns = ["", "ns", "ratio", "95% interval", "to", "goal"]
        print_table(section.title, columns, rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
