"""Set up JAX before its first use, here and on the workers of a Dask scheduler."""

import contextlib
import logging
import os
import socket
import warnings
from collections.abc import Iterator
from pathlib import Path

from jaxpf.contract.errors import InputError, import_extra
from jaxpf.files.executors import Pool
from jaxpf.running.cores import num_cores, use_cores

#: Seconds within which a scheduler must answer.
_PATIENCE = 5


def start_jax(devices: int | None = None, processes: int = 1) -> int:
    """Set up JAX before its first use: its number of host devices, and the compile cache.

    Args:
        devices: number of devices; by default the processes share all available cores equally.
        processes: number of processes that compute.

    Returns:
        The number of devices.
    """
    devices = devices or max(1, num_cores() // processes)
    with contextlib.suppress(InputError):  # a calling program already uses JAX
        use_cores(devices)
    use_compile_cache()
    return devices


def use_compile_cache() -> None:
    """Keep compiled kernels between runs in ``JAXPF_CACHE_DIR`` or the user's cache folder."""
    import jax

    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = os.environ.get("JAXPF_CACHE_DIR") or os.path.join(base, "jaxpf")
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError:
        return  # no home or a read-only disk: recompiling is only slower
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


@contextlib.contextmanager
def cluster(address: str, devices: int | None = None) -> Iterator[Pool]:
    """Connect to the scheduler at an address, set up JAX on its workers, and yield their pool.

    Args:
        address: such as ``tcp://127.0.0.1:8786``.
        devices: host devices per worker; by default one per core.

    Raises:
        InputError: Dask is not installed, no scheduler answers, it has no workers, or its workers
            have another version of jaxpf.
    """
    need = "--dask needs Dask, here and where the workers are"
    distributed = import_extra("distributed", need, "'jaxpf[cluster]'")
    # Dask logs every connection attempt on several lines.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # Test the address first, since a client that cannot connect logs an error again on
        # deletion.
        there = distributed.comm.get_address_host_port(address)
        socket.create_connection(there, _PATIENCE).close()
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError):
        raise InputError(
            f"--dask {address}: no scheduler answers there within {_PATIENCE} seconds; start one "
            "by `dask scheduler`, and give the address that it prints, such as tcp://127.0.0.1:8786."
        ) from None
    with client, warnings.catch_warnings():
        # Large pieces are intended: they carry the frames of a scene.
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
        workers = len(client.scheduler_info(n_workers=-1)["workers"])
        if not workers:
            raise InputError(
                f"--dask {address}: the scheduler has no workers; start some by `dask worker "
                f"{address} --nworkers 2 --nthreads 1`."
            )
        try:
            client.run(start_jax, devices)
        except Exception as error:  # any error on a worker
            raise InputError(
                f"--dask {address}: a worker cannot set jaxpf up ({type(error).__name__}: "
                f"{error}); install the same version there."
            ) from None
        yield Pool(client.get_executor, workers)
