"""``--dask ADDRESS``: share work among the workers of a Dask scheduler."""

import contextlib
import logging
import socket
import warnings
from collections.abc import Iterator

from jaxpf.cli.shared.startup import start_jax
from jaxpf.contract.errors import InputError, import_extra
from jaxpf.files.executors import Pool

#: Seconds within which a scheduler must answer.
_PATIENCE = 5


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
