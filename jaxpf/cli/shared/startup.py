"""Set up JAX before its first use."""

import contextlib
import os
from pathlib import Path

from jaxpf.contract.errors import InputError
from jaxpf.running.cores import num_cores, use_cores


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
