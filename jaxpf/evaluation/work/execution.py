"""Runs pieces of work in this process or on an executor, and recovers from killed workers."""

import collections
import concurrent.futures
import functools
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from typing import Any

from jaxpf.contract.errors import InputError

#: Times that a piece of work is repeated after a worker's death.
RETRIES = 3
#: Pieces in flight if an executor does not expose its number of workers.
IN_FLIGHT = 32

Factory = Callable[[], Executor]


def in_turn(
    function: Callable[[Any, int], Any],
    pieces: Iterable[Any],
    executor: Executor | Factory | None = None,
    *,
    retries: int = RETRIES,
) -> Iterator[tuple[Any, Any]]:
    """Yield (piece, ``function(piece, attempt)``) as pieces finish, in any order.

    The number of pieces in flight is bounded, so memory does not grow with the number of pieces.
    If a worker dies, the pieces in flight are repeated, on a new executor if the old one is broken
    and a factory was given.

    Args:
        function: a module's function, so that it can be pickled.
        pieces: picklable.
        executor: any ``concurrent.futures.Executor``, or a function without arguments that
            returns a new one, which is shut down at the end; by default this process.
        retries: times that a piece may be repeated because a worker died.

    Raises:
        InputError: a piece exceeded its retries, or the executor broke and there is no factory.
    """
    if executor is None:
        for piece in pieces:
            yield piece, function(piece, 0)
        return
    pool = _Pool(executor)
    waiting = collections.deque((piece, 0) for piece in pieces)
    flying: dict[Future, tuple[Any, int]] = {}
    try:
        while waiting or flying:
            try:
                while waiting and len(flying) < pool.in_flight:
                    piece, attempt = waiting[0]
                    future = pool.executor.submit(function, piece, attempt)
                    flying[future] = waiting.popleft()  # only now: if submit fails, it still waits
            except (concurrent.futures.BrokenExecutor, OSError):
                # If a pool breaks while it starts a process, its closed pipes raise OSError.
                if not flying:
                    piece, attempt = waiting.popleft()
                    if attempt >= retries:
                        raise
                    waiting.appendleft((piece, attempt + 1))
                    pool.renew()
                    continue
            done, _ = concurrent.futures.wait(
                flying, return_when=concurrent.futures.FIRST_COMPLETED
            )
            broken = False
            for future in done:
                piece, attempt = flying.pop(future)
                death = _death(future)
                if death is None:
                    yield piece, future.result()
                    continue
                if attempt >= retries:
                    raise InputError(
                        f"workers died {attempt + 1} times while {piece} was in progress, so it "
                        "was given up; what is finished is kept.  Most often memory runs out: use "
                        "fewer workers, fewer particles or a smaller memory budget."
                    ) from death
                waiting.appendleft((piece, attempt + 1))
                broken |= isinstance(death, concurrent.futures.BrokenExecutor)
            # A broken pool fails all pieces in flight: collect them before replacing the pool.
            if broken and not flying:
                pool.renew()
    finally:
        for future in flying:
            future.cancel()
        pool.close()


def local_pool(
    workers: int, devices: int | None = None, prepare: Callable[[], None] | None = None
) -> Factory:
    """Return a factory of local process pools, with the start method "spawn".

    Args:
        workers: number of processes.
        devices: host devices per process; by default the workers share the cores equally.
        prepare: picklable function that is called first in every process.
    """
    if devices is None:
        devices = max(1, num_cores() // max(workers, 1))
    for name, value in (("workers", workers), ("devices", devices)):
        if value < 1:
            raise InputError(f"{name} = {value} must be at least 1.")
    return functools.partial(
        ProcessPoolExecutor,
        max_workers=workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(devices, prepare),
    )


def num_cores() -> int:
    """Number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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


class _Pool:
    """An executor that can be replaced if a factory was given."""

    def __init__(self, executor: Executor | Factory):
        self.factory = None if isinstance(executor, Executor) else executor
        self.executor = executor if isinstance(executor, Executor) else executor()
        workers = getattr(self.executor, "_max_workers", None)
        # One more piece than workers, so that none idles while a result is collected.
        self.in_flight = IN_FLIGHT if workers is None else workers + 1

    def renew(self) -> None:
        """Replace a broken executor."""
        if self.factory is None:
            raise InputError(
                "a worker of the executor died and the executor is broken; evaluate again to do "
                "what is missing, and give a function that returns a new executor, so that it can "
                "be replaced."
            )
        self.executor.shutdown(wait=False)
        self.executor = self.factory()

    def close(self) -> None:
        """Shut down the executor if it came from the factory."""
        if self.factory is not None:
            self.executor.shutdown(wait=False)


def _death(future: Future) -> BaseException | None:
    """The error if a piece's worker died; None if the function returned or raised."""
    if future.cancelled():
        return concurrent.futures.CancelledError("the executor cancelled it")
    error = future.exception()
    if isinstance(error, concurrent.futures.BrokenExecutor | concurrent.futures.CancelledError):
        return error
    if error is None:
        return None
    # Dask's errors for dead workers, compared by name because importing Dask is slow.
    names = {kind.__name__ for kind in type(error).__mro__}
    died = names & {"KilledWorker", "FutureCancelledError"} or _raised_by_dask_itself(error)
    return error if died else None


def _raised_by_dask_itself(error: BaseException) -> bool:
    """Whether an error comes from Dask's executor rather than from the function.

    If a worker dies with a finished result, the task returns to waiting.  The executor may then
    treat the result it just received as an error and fail.
    """
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is not None and trace.tb_frame.f_globals["__name__"] == "distributed.cfexecutor"
