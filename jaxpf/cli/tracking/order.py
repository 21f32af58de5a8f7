"""``jaxpf track --order auto``: the order of partitioned sampling chosen by pilot runs."""

import dataclasses
import itertools
from collections.abc import Generator, Iterator
from typing import Any

import numpy as np

from jaxpf.cli.tracking.motion import again
from jaxpf.cli.tracking.request import Request

#: Frames that pilot runs follow, and how many of them there are of each order.
FRAMES, RUNS = 20, 16


def with_order(request: Request, order: tuple[int, ...] | None) -> Request:
    """The request with another order; None is the filter's own."""
    options = dataclasses.replace(request.filter_options, order=order)
    return dataclasses.replace(request, filter_options=options)


def chosen(
    request: Request, tracker: Any, frames: Iterator[np.ndarray]
) -> tuple[tuple[int, ...], str, Generator[np.ndarray, None, None]]:
    """The order whose runs differ least on the first frames.

    Args:
        request: the seed.
        tracker: in any order.
        frames: those after the start frame.

    Returns:
        The order; a sentence for people; the frames, all of them again.

    Raises:
        InputError: see ``best_order``.
    """
    import jax

    from jaxpf.filters.partitioned.options import order_label
    from jaxpf.tuning.orders import best_order

    head = list(itertools.islice(frames, FRAMES))
    # A key that no frame of the run has, nor --fit-motion.
    key = jax.random.fold_in(jax.random.key(request.run.seed), 2**32 - 2)
    pilot = best_order(tracker, key, np.stack(head), num_runs=RUNS)
    best, worst = pilot.orders[0], pilot.orders[-1]
    told = (
        f"of {len(pilot.orders)} orders {order_label(best)} was chosen by {RUNS} runs over "
        f"{len(head)} frames: their variance is {pilot.variance[0]:.2g} +- "
        f"{pilot.standard_error[0]:.1g} of the posterior's; of the worst, {order_label(worst)}, "
        f"{pilot.variance[-1]:.2g} +- {pilot.standard_error[-1]:.1g}."
    )
    return best, told, again(head, frames)
