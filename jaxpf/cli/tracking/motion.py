"""``jaxpf track --fit-motion``: motion chosen by the evidence of a clip's first frames."""

import itertools
from collections.abc import Generator, Iterator, Sequence
from typing import Any

import numpy as np

from jaxpf.cli.tracking.request import LEAST_FITTED, Request
from jaxpf.contract.options import options_of, plain
from jaxpf.targets.target import Looks, Start


def fitted(
    request: Request, start: Start, looks: Looks, frames: Iterator[np.ndarray]
) -> tuple[Any, str, Generator[np.ndarray, None, None]]:
    """The options whose motion makes the first frames likeliest.

    Args:
        request: how many frames to look at, and the seed; what is tracked, and how.
        start: where it starts.
        looks: from what the likelihood is learned.
        frames: those after the start frame.

    Returns:
        Options of the target; a sentence for people; the frames, all of them again.
    """
    import jax

    from jaxpf.tuning.evidence import log_evidences

    target = request.target
    head = list(itertools.islice(frames, request.run.fit_motion))
    again_all = again(head, frames)
    if len(head) < LEAST_FITTED:
        return request.model, f"{len(head)} frames are too few to fit the motion.", again_all
    candidates = target.motion_candidates(request.model)
    likelihood = target.likelihood(request.model, start, looks)
    trackers = [
        request.filter.tracker(target.model(one, start, likelihood), request.filter_options)
        for one in candidates
    ]
    # A key that no frame of the run has.
    key = jax.random.fold_in(jax.random.key(request.run.seed), 2**32 - 1)
    found = log_evidences(trackers, key, np.stack(head))
    best = int(np.argmax(found))
    return candidates[best], _told(candidates, found, best, len(head)), again_all


def again(
    head: list[np.ndarray], frames: Iterator[np.ndarray]
) -> Generator[np.ndarray, None, None]:
    """All frames from the first; a generator, which closes the source with it."""
    yield from head
    yield from frames


def _told(candidates: Sequence[Any], found: np.ndarray, best: int, count: int) -> str:
    names = [
        name
        for name in options_of(candidates[0])
        if len({getattr(one, name) for one in candidates}) > 1
    ]
    values = ", ".join(
        f"--{name.replace('_', '-')} {plain(getattr(candidates[best], name))}" for name in names
    )
    return (
        f"the motion was fitted to {count} frames: {values}; the log evidence is "
        f"{found[best] - found[0]:.1f} above that of what was given."
    )
