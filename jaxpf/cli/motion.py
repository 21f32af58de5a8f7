"""``jaxpf track --fit-motion``: motion chosen by the evidence of a clip's first frames."""

import itertools
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any

import click
import numpy as np

from jaxpf.errors import InputError
from jaxpf.options import options_of, plain
from jaxpf.targets.target import Looks, Start, Target

#: So many frames hold a walk or a throw; fewer leave the evidence undecided.
LEAST = 5


def option() -> Callable:
    """The flag."""
    return click.option(
        "--fit-motion",
        type=int,
        metavar="FRAMES",
        help="Choose the motion's noise and momentum by the evidence of so many frames after the "
        "start frame, such as 30; run.toml keeps what was found.  [default: as given]",
    )


def check_fit(options: dict[str, Any], target: Target, model: Any, opens: bool) -> None:
    """Refuse to fit the motion where there is none to fit.

    Raises:
        InputError: the sentence says why.
    """
    count = options["fit_motion"]
    if count is None:
        return
    if count < LEAST:
        raise InputError(f"--fit-motion {count} must be at least {LEAST} frames.")
    if options["tracker"]:
        raise InputError("--fit-motion is about the built-in motion; leave it or --tracker out.")
    if opens:
        raise InputError(
            "--fit-motion needs objects that are there in the start frame; leave it or --births "
            "out."
        )
    target.motion_candidates(model)


def fitted(
    options: dict[str, Any],
    target: Target,
    setup: Any,
    start: Start,
    looks: Looks,
    frames: Iterator[np.ndarray],
) -> tuple[Any, str, Generator[np.ndarray, None, None]]:
    """The options whose motion makes the first frames likeliest.

    Args:
        options: of the command: how many frames to look at, and the seed.
        target: what is tracked.
        setup: ``filter``, ``model`` and ``filter_options`` of the run.
        start: where it starts.
        looks: from what the likelihood is learned.
        frames: those after the start frame.

    Returns:
        Options of the target; a sentence for people; the frames, all of them again.
    """
    import jax

    from jaxpf.tuning.evidence import log_evidences

    head = list(itertools.islice(frames, options["fit_motion"]))
    again = _again(head, frames)
    if len(head) < LEAST:
        return setup.model, f"{len(head)} frames are too few to fit the motion.", again
    candidates = target.motion_candidates(setup.model)
    model = target.model(setup.model, start, looks)
    trackers = [
        setup.filter.tracker(target.with_motion(model, one, start), setup.filter_options)
        for one in candidates
    ]
    # A key that no frame of the run has.
    key = jax.random.fold_in(jax.random.key(options["seed"]), 2**32 - 1)
    found = log_evidences(trackers, key, np.stack(head))
    best = int(np.argmax(found))
    return candidates[best], _told(candidates, found, best, len(head)), again


def _again(
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
