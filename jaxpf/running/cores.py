"""The processor cores of this machine, and how JAX uses them."""

import functools
import os
import warnings

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.lowering import platform


def num_cores() -> int:
    """Number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def use_cores(cores: int | None = None) -> int:
    """Let ``monte_carlo`` use several cores of a CPU; by default all that this process may use.

    One device of JAX uses little more than one core, so each core becomes a device.  Call it before
    the first computation; on a machine with a GPU it changes nothing there.

    Example::

        jaxpf.use_cores()  # first of all
        summaries = jaxpf.monte_carlo(tracker, keys, y)

    Args:
        cores: number of cores.

    Returns:
        The number of cores.

    Raises:
        InputError: JAX has already started, with another number.
    """
    import jax

    cores = num_cores() if cores is None else cores
    check_whole("cores", cores)
    try:
        jax.config.update("jax_num_cpu_devices", cores)
    except RuntimeError:
        started = len(jax.devices("cpu"))
        if started != cores:
            raise InputError(
                f"JAX has already started with {started} of {cores} cores; call jaxpf.use_cores() "
                "first, before anything is computed."
            ) from None
    return cores


def num_idle_cores() -> int:
    """Number of cores that JAX leaves unused because it has a single CPU device."""
    import jax

    single = jax.local_device_count() == 1 and not platform.on_accelerator()
    return num_cores() - 1 if single else 0


@functools.cache
def say_that_cores_are_idle() -> None:
    """Warn once of cores that a single CPU device leaves unused."""
    warnings.warn(
        f"runs use one of {num_cores()} cores; to use all, call jaxpf.use_cores() before anything "
        "is computed.  Passing devices=jax.devices() silences this warning.",
        stacklevel=3,
    )
