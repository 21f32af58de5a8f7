"""Work on executors: in any order, a bounded number at a time, and after a worker's death."""

import asyncio
import collections
import concurrent.futures
import functools
import multiprocessing
import subprocess
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
from worker_functions import (
    HERE,
    always_die,
    die_once,
    host_devices,
    refused,
    set_prepared,
    squared,
)

from jaxpf import InputError
from jaxpf.evaluation.engine import Pool, local_pool
from jaxpf.files.executors import in_turn
from jaxpf.running.cores import num_cores

PIECES = {str(piece): piece for piece in range(12)}
SQUARES = {name: piece**2 for name, piece in PIECES.items()}


def start_two():
    """Two running workers: one that starts while the other dies is waited for without end."""
    pool = ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))
    concurrent.futures.wait([pool.submit(time.sleep, 0.5) for _ in range(2)])
    return pool


def as_dict(pieces):
    found = list(pieces)
    assert len(found) == len(dict(found))
    return dict(found)


def test_without_a_pool_pieces_are_done_here_in_order():
    assert list(in_turn(squared, PIECES)) == list(SQUARES.items())


@pytest.mark.parametrize("start", [lambda: ThreadPoolExecutor(3), start_two], ids=["threads", "2"])
def test_executors_do_every_piece_once(start):
    assert as_dict(in_turn(squared, PIECES, Pool(start, 2))) == SQUARES


class Pieces(ThreadPoolExecutor):
    """Threads that keep what is handed over; ``before`` may raise, or answer in their place."""

    def __init__(self, workers, before=lambda pool, work: None):
        super().__init__(workers)
        self.before, self.handed = before, []

    def submit(self, *work):
        answer = self.before(self, work)
        self.handed.append(work)
        return answer or super().submit(*work)


@pytest.mark.parametrize("after", [0, 2])
def test_a_pool_that_breaks_while_a_piece_is_handed_over_is_replaced(after):
    made = []

    def breaks(pool, work):
        if pool is made[0] and len(pool.handed) == after:
            raise OSError("handle is closed")

    def start():
        made.append(Pieces(3, breaks))
        return made[-1]

    assert as_dict(in_turn(squared, PIECES, Pool(start, 3))) == SQUARES
    assert len(made) == 2


def test_a_pool_that_cannot_be_started_is_given_up():
    def breaks(pool, work):
        raise OSError("too many open files")

    with pytest.raises(InputError, match="workers died 4 times while 0 was in progress"):
        as_dict(in_turn(squared, PIECES, Pool(lambda: Pieces(1, breaks), 1)))


def test_only_a_few_pieces_are_in_flight():
    """Results that nobody has collected yet do not pile up."""
    pool = Pieces(2)
    pieces = in_turn(squared, {str(i): i for i in range(1000)}, Pool(lambda: pool, workers=2))
    for _ in range(10):
        next(pieces)
    assert len(pool.handed) <= 13
    pieces.close()


def test_an_error_of_the_function_reaches_the_caller_at_once():
    with pytest.raises(InputError, match="is refused"):
        list(in_turn(refused, PIECES, Pool(start_two, 2)))


@pytest.mark.slow
def test_after_a_death_the_pool_is_replaced_and_only_pieces_in_flight_are_repeated(tmp_path):
    function = functools.partial(die_once, folder=str(tmp_path))
    pools = []

    def start():
        pools.append(start_two())
        return pools[-1]

    assert as_dict(in_turn(function, PIECES, Pool(start, workers=2))) == SQUARES
    calls = [path.name.split("-") for path in tmp_path.iterdir()]
    times = collections.Counter(piece for piece, *_ in calls)
    repeated = {piece for piece, count in times.items() if count > 1}
    assert "5" in repeated
    # Workers + 1 were in flight at each death; a busy machine may bring others than ours.
    deaths = len(pools) - 1
    assert deaths >= 1
    assert len(repeated) <= 3 * deaths
    assert max(times.values()) <= deaths + 1
    assert len({process for _, process, _ in calls}) >= 3  # of two pools


def test_a_piece_that_kills_its_worker_every_time_is_given_up():
    with pytest.raises(InputError, match="workers died 4 times while 5 was in progress") as error:
        as_dict(in_turn(always_die, {"5": 5}, Pool(start_two, 2)))
    assert isinstance(error.value.__cause__, BrokenProcessPool)


def test_cancelled_work_is_done_again():
    """As when a cluster loses the tasks of a worker."""
    lost = []

    def forget(pool, work):
        if work[2] != 5 or lost:
            return None
        lost.append(Future())
        lost[0].cancel()
        lost[0].set_running_or_notify_cancel()
        return lost[0]

    assert as_dict(in_turn(squared, PIECES, Pool(lambda: Pieces(2, forget), 2))) == SQUARES
    assert lost


@pytest.mark.slow
def test_a_local_pool_starts_anew_with_its_own_devices():
    assert num_cores() >= 1
    ((_, found),) = in_turn(host_devices, {"a": 0}, local_pool(1, 3, set_prepared))
    assert found == (3, "spawn", "yes")


def is_running(process):
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs Linux's /proc")
def test_workers_end_when_their_parent_is_killed():
    code = "import worker_functions; worker_functions.parent_of_a_pool()"
    parent = subprocess.Popen(
        [sys.executable, "-c", code], cwd=HERE, stdout=subprocess.PIPE, text=True
    )
    worker = int(parent.stdout.readline())
    assert is_running(worker)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 600
    while is_running(worker) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(worker)


@pytest.fixture(scope="module")
def dask_client():
    """A Dask cluster of two processes on this machine."""
    distributed = pytest.importorskip(
        "distributed", reason="needs Dask: pip install jaxpf[cluster]"
    )
    dask = pytest.importorskip("dask")
    with (
        dask.config.set(
            {
                "distributed.scheduler.allowed-failures": 0,
                # What a killed worker held is asked of it in vain before it is done again.
                "distributed.comm.timeouts.connect": "1s",
            }
        ),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.mark.slow
def test_a_result_that_dask_loses_with_its_worker_is_made_again():
    """Dask's executor fails on a task that went back from finished to pending."""
    cfexecutor = pytest.importorskip("distributed.cfexecutor", reason="needs jaxpf[cluster]")

    class Lost:
        status = "pending"

        async def _result(self, raiseit):
            return 9

    lost = Future()

    async def cascade():
        await cfexecutor._cascade_future(Lost(), lost)

    asyncio.run(cascade())
    with pytest.raises(TypeError):
        lost.result()
    first = [lost]
    pool = Pool(lambda: Pieces(1, lambda *work: first.pop() if first else None), 1)
    assert as_dict(in_turn(squared, PIECES, pool)) == SQUARES


@pytest.mark.slow
def test_dask_does_every_piece_and_outlives_a_killed_worker(dask_client, tmp_path):
    pool = Pool(dask_client.get_executor, 2)
    assert as_dict(in_turn(squared, PIECES, pool)) == SQUARES
    function = functools.partial(die_once, folder=str(tmp_path))
    assert as_dict(in_turn(function, PIECES, pool)) == SQUARES
    calls = [path.name.split("-") for path in tmp_path.iterdir()]
    assert [piece for piece, *_ in calls].count("5") == 2
    assert {piece for piece, *_ in calls} == PIECES.keys()
