"""Resolve the open options of a request ("auto", --fit-motion) before building the tracker."""

import dataclasses
import itertools
from collections.abc import Generator, Iterator, Sequence
from typing import Any

import numpy as np

from jaxpf.cli.tracking.request import LEAST_FITTED, Request
from jaxpf.contract.options import options_of, plain
from jaxpf.running.memory import check_memory, needed_by
from jaxpf.targets.building import looks_of_frame
from jaxpf.targets.target import Start

#: Number of frames of pilot runs that choose an order, and of runs per order.
PILOT_FRAMES, PILOT_RUNS = 20, 16
#: Advice when memory is insufficient.
LESS_MEMORY = "ask for fewer particles (-n)"


@dataclasses.dataclass(frozen=True)
class Settled:
    """Fully resolved options.

    Attributes:
        model: options of the target.
        filter_options: options of the filter.
        likelihood: learned from the start frame; None for births and for a user-defined tracker.
        remarks: sentences that explain the choices.
        frames: all frames after the start frame.
    """

    model: Any
    filter_options: Any
    likelihood: Any
    remarks: tuple[str, ...]
    frames: Generator[np.ndarray, None, None]


def settle(
    request: Request, start: Start, first: np.ndarray, frames: Generator[np.ndarray, None, None]
) -> Settled:
    """Choose the motion and the order, if requested.

    Args:
        request: the request.
        start: where objects start.
        first: the start frame.
        frames: frames after the start frame.

    Raises:
        InputError: the filter or the likelihood refuses the request.
    """
    model, options = request.model, request.filter_options
    if request.run.tracker or request.births is not None:
        return Settled(model, options, None, (), frames)
    if request.chooses_order:
        options = dataclasses.replace(options, order=None)
    request.filter.check(options, start.parents)
    looks = looks_of_frame(first, options.particles)
    model = request.target.resolved(model, looks.is_filmed)
    likelihood = request.target.likelihood(model, start, looks)
    remarks: list[str] = []

    def tracker_with(motion: Any) -> Any:
        tracker = request.filter.tracker(request.target.model(motion, start, likelihood), options)
        check_memory(needed_by(tracker), LESS_MEMORY)
        return tracker

    if request.run.fit_motion is not None:
        head = list(itertools.islice(frames, request.run.fit_motion))
        frames = chain(head, frames)
        if len(head) < LEAST_FITTED:
            remarks.append(f"{len(head)} frames are too few to fit the motion.")
        else:
            candidates = request.target.motion_candidates(model)
            trackers = [tracker_with(candidate) for candidate in candidates]
            model, remark = _fit_motion(request.run.seed, candidates, trackers, np.stack(head))
            remarks.append(remark)
    if request.chooses_order:
        head = list(itertools.islice(frames, PILOT_FRAMES))
        frames = chain(head, frames)
        order, remark = _choose_order(request.run.seed, tracker_with(model), np.stack(head))
        options = dataclasses.replace(options, order=order)
        remarks.append(remark)
    return Settled(model, options, likelihood, tuple(remarks), frames)


def chain(
    head: list[np.ndarray], frames: Iterator[np.ndarray]
) -> Generator[np.ndarray, None, None]:
    """A generator over all frames including the first; closing it closes the source."""
    yield from head
    yield from frames


def _fit_motion(
    seed: int, candidates: Sequence[Any], trackers: Sequence[Any], head: np.ndarray
) -> tuple[Any, str]:
    """The motion candidate with the largest evidence, and a sentence about it."""
    import jax

    from jaxpf.tuning.evidence import log_evidences

    # A key that no frame of the run uses.
    key = jax.random.fold_in(jax.random.key(seed), 2**32 - 1)
    evidences = log_evidences(trackers, key, head)
    best = int(np.argmax(evidences))
    names = [
        name
        for name in options_of(candidates[0])
        if len({getattr(candidate, name) for candidate in candidates}) > 1
    ]
    values = ", ".join(
        f"--{name.replace('_', '-')} {plain(getattr(candidates[best], name))}" for name in names
    )
    return candidates[best], (
        f"the motion was fitted to {len(head)} frames: {values}; its log evidence is "
        f"{evidences[best] - evidences[0]:.1f} above that of the given motion."
    )


def _choose_order(seed: int, tracker: Any, head: np.ndarray) -> tuple[tuple[int, ...], str]:
    """The order with the least variance over pilot runs, and a sentence about it."""
    import jax

    from jaxpf.filters.partitioned.options import order_label
    from jaxpf.tuning.orders import best_order

    # A key that neither a frame of the run nor --fit-motion uses.
    key = jax.random.fold_in(jax.random.key(seed), 2**32 - 2)
    pilot = best_order(tracker, key, head, num_runs=PILOT_RUNS)
    best, worst = pilot.orders[0], pilot.orders[-1]
    return best, (
        f"of {len(pilot.orders)} orders {order_label(best)} was chosen by {PILOT_RUNS} runs over "
        f"{len(head)} frames: its variance between runs is {pilot.variance[0]:.2g} +- "
        f"{pilot.standard_error[0]:.1g} of the posterior's; that of the worst, "
        f"{order_label(worst)}, is {pilot.variance[-1]:.2g} +- {pilot.standard_error[-1]:.1g}."
    )
