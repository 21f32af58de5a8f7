"""Runs pieces of work in this process or on an executor, and recovers from killed workers."""

import collections
import concurrent.futures
import functools
import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from typing import Any, NamedTuple

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.running.memory import num_cores

#: Times that a piece of work is repeated after a worker's death.
RETRIES = 3

Factory = Callable[[], Executor]


class Pool(NamedTuple):
    """A factory of executors, with their number of workers.

    Attributes:
        start: function without arguments that returns a new executor.
        workers: of each executor; one piece of work more is in flight at a time.
    """

    start: Factory
    workers: int

    def __call__(self) -> Executor:
        """Start an executor."""
        return self.start()


def in_turn(
    function: Callable[[Any, int], Any],
    pieces: Iterable[Any],
    executor: Executor | Factory | Pool | None = None,
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
            returns a new one, which is shut down at the end; by default this process.  Give a
            ``Pool`` if it has not one worker per core of this machine.
        retries: times that a piece may be repeated because a worker died.

    Raises:
        InputError: a piece exceeded its retries, or the executor broke and there is no factory.
    """
    if executor is None:
        for piece in pieces:
            yield piece, function(piece, 0)
        return
    pool, guarded = _Renewable(executor), functools.partial(_outcome, function)
    waiting = collections.deque((piece, 0) for piece in pieces)
    flying: dict[Future, tuple[Any, int]] = {}
    try:
        while waiting or flying:
            try:
                while waiting and len(flying) < pool.in_flight:
                    piece, attempt = waiting[0]
                    future = pool.executor.submit(guarded, piece, attempt)
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
                failure = _failure(future)
                if failure is None:
                    outcome = future.result()
                    if outcome.error is not None:
                        raise outcome.error
                    yield piece, outcome.value
                    continue
                if attempt >= retries:
                    raise InputError(
                        f"workers died {attempt + 1} times while {piece} was in progress "
                        f"({type(failure).__name__}), so it was given up; what is finished is "
                        "kept.  Most often memory runs out: use fewer workers, fewer particles or "
                        "a smaller memory budget."
                    ) from failure
                waiting.appendleft((piece, attempt + 1))
                broken |= isinstance(failure, concurrent.futures.BrokenExecutor)
            # A broken pool fails all pieces in flight: collect them before replacing the pool.
            if broken and not flying:
                pool.renew()
    finally:
        for future in flying:
            future.cancel()
        pool.close()


def local_pool(
    workers: int, devices: int | None = None, prepare: Callable[[], None] | None = None
) -> Pool:
    """Local process pools, with the start method "spawn".

    Args:
        workers: number of processes.
        devices: host devices per process; by default the workers share the cores equally.
        prepare: picklable function that is called first in every process.
    """
    check_whole("workers", workers)
    if devices is None:
        devices = max(1, num_cores() // workers)
    check_whole("devices", devices)
    start = functools.partial(
        ProcessPoolExecutor,
        max_workers=workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(devices, prepare),
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


class _Renewable:
    """An executor that can be replaced if a factory was given."""

    def __init__(self, given: Executor | Factory | Pool):
        self.factory = None if isinstance(given, Executor) else given
        self.executor = given if isinstance(given, Executor) else given()
        workers = given.workers if isinstance(given, Pool) else num_cores()
        # One more piece than workers, so that none idles while a result is collected.
        self.in_flight = workers + 1

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


class _Outcome(NamedTuple):
    """What a function returned, or the error that it raised."""

    value: Any
    error: Exception | None = None


def _outcome(function: Callable[[Any, int], Any], piece: Any, attempt: int) -> _Outcome:
    """Call the function in a worker.

    Its own errors are returned, so every error of the future is a failure of the executor.
    """
    try:
        return _Outcome(function(piece, attempt))
    except Exception as error:
        error.add_note("".join(traceback.format_exception(error)))  # tracebacks are not pickled
        return _Outcome(None, error)


def _failure(future: Future) -> BaseException | None:
    """Why the executor did not return the outcome of a piece: most often its worker died."""
    if future.cancelled():
        return concurrent.futures.CancelledError("the executor cancelled it")
    return future.exception()
