"""Pieces of work on any executor of ``concurrent.futures``, repeated if a worker dies."""

import collections
import functools
import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from typing import Any, NamedTuple

from jaxpf.contract.errors import InputError
from jaxpf.running.cores import num_cores

#: Times that a piece of work is repeated after a worker's death.
RETRIES = 3


class Pool(NamedTuple):
    """Workers: processes, threads, or those of a cluster.

    Attributes:
        start: function without arguments that returns a new executor, such as
            ``functools.partial(ThreadPoolExecutor, 4)`` or Dask's ``client.get_executor``.
        workers: of each executor; one piece of work more is in flight at a time.
    """

    start: Callable[[], Executor]
    workers: int


def in_turn(
    function: Callable[[Any], Any], pieces: Mapping[str, Any], pool: Pool | None = None
) -> Iterator[tuple[str, Any]]:
    """Yield (name, ``function(piece)``) as pieces finish, in any order.

    Only as many pieces as there are workers, and one more, are in flight, so that results do not
    pile up.  If a worker dies, the pieces in flight are repeated on a new executor.

    Args:
        function: a module's function, so that it can be pickled; its errors reach the caller.
        pieces: by name, for messages; picklable.
        pool: the workers; by default this process, in order.

    Raises:
        InputError: a piece was repeated ``RETRIES`` times because a worker died.
    """
    if pool is None:
        for name, piece in pieces.items():
            yield name, function(piece)
        return
    waiting = collections.deque((name, 0) for name in pieces)
    while waiting:
        executor = pool.start()
        flying: dict[Future, tuple[str, int]] = {}
        lost: list[tuple[str, int, Exception]] = []
        try:
            while flying or (waiting and not lost):
                while waiting and not lost and len(flying) <= pool.workers:
                    name, attempt = waiting.popleft()
                    try:
                        # Dask would merge equal calls; the attempt tells a repeated one apart.
                        future = executor.submit(_outcome, function, pieces[name], attempt)
                    except (BrokenExecutor, OSError) as death:
                        # A pool that breaks while it starts a process has closed its pipes.
                        lost.append((name, attempt, death))
                    else:
                        flying[future] = name, attempt
                for future in wait(flying, return_when=FIRST_COMPLETED).done:
                    name, attempt = flying.pop(future)
                    try:
                        value, error = future.result()
                    except Exception as death:  # not of the function
                        lost.append((name, attempt, death))
                        continue
                    if error is not None:
                        raise error
                    yield name, value
        finally:
            for future in flying:
                future.cancel()
            executor.shutdown(wait=False)
        for name, attempt, cause in lost:
            if attempt >= RETRIES:
                raise InputError(
                    f"workers died {attempt + 1} times while {name} was in progress "
                    f"({type(cause).__name__}), so it was given up; what is finished is kept.  "
                    "Most often memory runs out: use fewer workers or fewer particles."
                ) from cause
            waiting.appendleft((name, attempt + 1))


def _outcome(
    function: Callable[[Any], Any], piece: Any, attempt: int
) -> tuple[Any, Exception | None]:
    """In a worker: what the function returned, or its error.

    The error is returned, so every error of the future is a failure of the executor.
    """
    try:
        return function(piece), None
    except Exception as error:
        error.add_note("".join(traceback.format_exception(error)))  # tracebacks are not pickled
        return None, error


def local_pool(
    workers: int, devices: int | None = None, prepare: Callable[[], None] | None = None
) -> Pool:
    """Local processes, with the start method "spawn", among which by default the cores are divided.

    ``prepare`` is a picklable function that is called first in every process.
    """
    start = functools.partial(
        ProcessPoolExecutor,
        max_workers=workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(devices or max(1, num_cores() // workers), prepare),
    )
    return Pool(start, workers)


def _start_worker(devices: int, prepare: Callable[[], None] | None) -> None:
    # Ctrl-C reaches the whole process group: exit without a traceback; the parent reports it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_follow_parent, daemon=True).start()
    import jax

    jax.config.update("jax_num_cpu_devices", devices)
    if prepare is not None:
        prepare()


def _follow_parent() -> None:
    """Exit when the parent does; otherwise the workers of a killed parent would wait forever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
