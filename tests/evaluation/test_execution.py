"""Work on executors: in any order, a bounded number at a time, and after a worker's death."""

import asyncio
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
from jaxpf.evaluation import Pool, local_pool
from jaxpf.evaluation.work.execution import in_turn
from jaxpf.running.memory import num_cores

PIECES = list(range(12))


def start_two():
    """Two running workers: one that starts while the other dies is waited for without end."""
    pool = ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))
    concurrent.futures.wait([pool.submit(time.sleep, 0.5) for _ in range(2)])
    return pool


def as_dict(pieces):
    found = list(pieces)
    assert len(found) == len(dict(found))
    return dict(found)


SQUARES = {piece: piece**2 for piece in PIECES}


def test_without_an_executor_pieces_are_done_here_in_order():
    assert list(in_turn(squared, PIECES)) == list(SQUARES.items())


@pytest.mark.parametrize("make", [lambda: ThreadPoolExecutor(3), start_two], ids=["threads", "2"])
def test_executors_and_factories_do_every_piece_once(make):
    assert as_dict(in_turn(squared, PIECES, make)) == SQUARES
    with make() as executor:
        assert as_dict(in_turn(squared, PIECES, executor)) == SQUARES
        assert executor.submit(squared, 3, 0).result() == 9  # not ours to shut down


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

    assert as_dict(in_turn(squared, PIECES, start)) == SQUARES
    assert len(made) == 2


def test_a_pool_that_cannot_be_started_is_given_up():
    def breaks(pool, work):
        raise OSError("too many open files")

    with pytest.raises(OSError, match="too many open files"):
        as_dict(in_turn(squared, PIECES, lambda: Pieces(1, breaks)))


def test_only_a_few_pieces_are_in_flight():
    """Results that nobody has collected yet do not pile up."""
    pool = Pieces(2)
    pieces = in_turn(squared, range(1000), Pool(lambda: pool, workers=2))
    for _ in range(10):
        next(pieces)
    assert len(pool.handed) <= 13
    pieces.close()


def test_an_error_of_the_function_reaches_the_caller_at_once():
    with pytest.raises(InputError, match="is refused"):
        list(in_turn(refused, PIECES, start_two))


@pytest.mark.slow
def test_after_a_death_the_pool_is_replaced_and_only_pieces_in_flight_are_repeated(tmp_path):
    function = functools.partial(die_once, folder=str(tmp_path))
    pools = []

    def start():
        pools.append(start_two())
        return pools[-1]

    assert as_dict(in_turn(function, PIECES, Pool(start, workers=2))) == SQUARES
    calls = [path.name.split("-") for path in tmp_path.iterdir()]
    repeated = {int(piece) for piece, attempt, *_ in calls if attempt != "0"}
    assert 5 in repeated
    # Workers + 1 were in flight at each death; a busy machine may bring others than ours.
    deaths = len(pools) - 1
    assert deaths >= 1
    assert len(repeated) <= 3 * deaths
    assert 1 <= max(int(attempt) for _, attempt, *_ in calls) <= deaths
    assert len({process for *_, process, _ in calls}) >= 3  # of two pools


def test_a_piece_that_kills_its_worker_every_time_is_given_up():
    with pytest.raises(InputError, match="workers died 2 times while 5 was in progress") as error:
        as_dict(in_turn(always_die, [5], start_two, retries=1))
    assert isinstance(error.value.__cause__, BrokenProcessPool)


def test_a_broken_executor_without_factory_is_reported_in_a_sentence(tmp_path):
    with start_two() as executor:
        function = functools.partial(die_once, folder=str(tmp_path))
        with pytest.raises(InputError, match="give a function that returns a new executor"):
            list(in_turn(function, PIECES, executor))


def test_cancelled_work_is_done_again():
    """As when a cluster loses the tasks of a worker."""
    lost = []

    def forget(pool, work):
        if work[1] != 5 or lost:
            return None
        lost.append(Future())
        lost[0].cancel()
        lost[0].set_running_or_notify_cancel()
        return lost[0]

    assert as_dict(in_turn(squared, PIECES, lambda: Pieces(2, forget))) == SQUARES
    assert lost


@pytest.mark.slow
def test_a_local_pool_starts_anew_with_its_own_devices():
    assert num_cores() >= 1
    ((_, found),) = in_turn(host_devices, [0], local_pool(1, 3, set_prepared))
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
def test_a_result_that_dask_loses_with_its_worker_is_made_again(monkeypatch):
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
    with ThreadPoolExecutor(1) as executor:
        submit = executor.submit
        futures = iter([lost])
        monkeypatch.setattr(executor, "submit", lambda *work: next(futures, None) or submit(*work))
        assert as_dict(in_turn(squared, PIECES, executor)) == SQUARES


@pytest.mark.slow
def test_dask_does_every_piece_and_outlives_a_killed_worker(dask_client, tmp_path):
    executor = dask_client.get_executor()
    assert as_dict(in_turn(squared, PIECES, executor)) == SQUARES
    function = functools.partial(die_once, folder=str(tmp_path))
    assert as_dict(in_turn(function, PIECES, dask_client.get_executor)) == SQUARES
    calls = [path.name.split("-") for path in tmp_path.iterdir()]
    assert ["5", "1"] in [call[:2] for call in calls]
    assert {piece for piece, *_ in calls} == set(map(str, PIECES))
