"""What workers are told to do: functions that a process started anew can import."""

import multiprocessing
import os
import signal
import time
from pathlib import Path

from jaxpf import InputError
from jaxpf.evaluation import local_pool
from jaxpf.evaluation.work.execution import in_turn

#: Where a started program finds this module.
HERE = Path(__file__).parent


def squared(piece, attempt):
    return piece**2


def refused(piece, attempt):
    raise InputError(f"piece {piece} is refused")


def die_once(piece, attempt, folder):
    """Note the call; the worker kills itself at piece 5, the first time."""
    marker = Path(folder) / f"{piece}-{attempt}-{os.getpid()}-{time.monotonic_ns()}"
    marker.touch()
    if piece == 5 and attempt == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02)
    return piece**2


def always_die(piece, attempt):
    if piece == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return piece**2


def host_devices(piece, attempt):
    import jax

    return jax.device_count(), multiprocessing.get_start_method(), os.environ.get("PREPARED")


def set_prepared():
    os.environ["PREPARED"] = "yes"


def parent_of_a_pool():
    """Start a pool, tell the processes, and wait to be killed."""
    for _, process in in_turn(process_id, [0], local_pool(1, 1)):
        print(process, flush=True)
        time.sleep(60)


def process_id(piece, attempt):
    return os.getpid()
