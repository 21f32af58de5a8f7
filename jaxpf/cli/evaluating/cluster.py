"""``--dask ADDRESS``: work that the workers of a Dask scheduler share."""

import contextlib
import logging
import socket
import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

from jaxpf.cli.shared.startup import start_jax
from jaxpf.contract.errors import InputError

#: Seconds in which a scheduler must answer.
_PATIENCE = 5


class Cluster(NamedTuple):
    """Where pieces are computed.

    Attributes:
        workers: how many there are.
        executor: a new one, as ``jaxpf.evaluation.carry_out`` takes it.
    """

    workers: int
    executor: Any


@contextlib.contextmanager
def cluster(address: str, devices: int | None = None) -> Iterator[Cluster]:
    """The workers of the scheduler at an address, with JAX set up.

    Args:
        address: such as ``tcp://127.0.0.1:8786``.
        devices: host devices of each worker; all its cores by default.

    Raises:
        InputError: Dask is not installed, nobody answers, nobody works there, or workers have not
            this version of jaxpf.
    """
    try:
        import distributed
    except ModuleNotFoundError:
        raise InputError(
            "--dask needs Dask, here and where the workers are: pip install 'jaxpf[cluster]'."
        ) from None
    # It tells of every attempt in several lines.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # Beforehand, since a client that reaches nobody complains again when it is thrown away.
        there = distributed.comm.get_address_host_port(address)
        socket.create_connection(there, _PATIENCE).close()
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError):
        raise InputError(
            f"--dask {address}: no scheduler answers there within {_PATIENCE} seconds; start one "
            "by `dask scheduler`, and give the address that it prints, such as tcp://127.0.0.1:8786."
        ) from None
    with client, warnings.catch_warnings():
        # A piece that carries the frames of a scene is what is meant.
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
        workers = len(client.scheduler_info(n_workers=-1)["workers"])
        if not workers:
            raise InputError(
                f"--dask {address}: the scheduler has no workers; start some by `dask worker "
                f"{address} --nworkers 2 --nthreads 1`."
            )
        try:
            client.run(start_jax, devices)
        except Exception as error:  # whatever goes wrong over there
            raise InputError(
                f"--dask {address}: a worker cannot set jaxpf up ({type(error).__name__}: "
                f"{error}); install the same version there."
            ) from None
        yield Cluster(workers, client.get_executor)
