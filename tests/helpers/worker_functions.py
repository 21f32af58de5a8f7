"""What workers are told to do: functions that a process started anew can import."""

import multiprocessing
import os
import signal
import time
from pathlib import Path

from jaxpf import InputError
from jaxpf.evaluation.engine import local_pool
from jaxpf.files.executors import in_turn

#: Where a started program finds this module.
HERE = Path(__file__).parent


def squared(piece):
    return piece**2


def refused(piece):
    raise InputError(f"piece {piece} is refused")


def die_once(piece, folder):
    """Note the call; the worker kills itself at piece 5, the first time."""
    is_first = not any(Path(folder).glob(f"{piece}-*"))
    (Path(folder) / f"{piece}-{os.getpid()}-{time.monotonic_ns()}").touch()
    if piece == 5 and is_first:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02)
    return piece**2


def always_die(piece):
    if piece == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return piece**2


def host_devices(piece):
    import jax

    return jax.device_count(), multiprocessing.get_start_method(), os.environ.get("PREPARED")


def set_prepared():
    os.environ["PREPARED"] = "yes"


def parent_of_a_pool():
    """Start a pool, tell the processes, and wait to be killed."""
    for _, process in in_turn(process_id, {"a": 0}, local_pool(1, 1)):
        print(process, flush=True)
        time.sleep(60)


def process_id(piece):
    return os.getpid()
