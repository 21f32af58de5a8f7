"""Programs kept on disk as traced, so that a command's next start need not trace them again.

JAX's compile cache keeps what XLA made of a program, but knows it only by the traced and lowered
program, and to trace and lower a filter takes longer than all the rest of a second start.  So a
command that runs one program again and again keeps that, too (``jax.export``), beside the
compile cache.  A kept program is used only where everything that it was traced from is the same:
this package's source text, JAX's version and settings, the devices, and the shapes and static
parts of the arguments.
"""

import contextlib
import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax import export
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from jaxpf.files import atomic_write

_DIGEST_SIZE = 32


def run_exported(function: Callable, *arguments: Any, **constants: Any) -> Any:
    """``jax.jit(function)(*arguments)``, traced once per machine and shape of the arguments.

    Without a folder for JAX's compile cache: once per process.

    Args:
        function: pure, of this package or of ``scenes``, and calling no code but theirs, JAX's
            and NumPy's: changes of other code would go unnoticed.  It returns tuples, lists
            and dictionaries of arrays.
        arguments: pytrees of arrays.
        constants: what the program is made for; hashable, with a ``repr`` that tells all.
    """
    leaves, treedef = jax.tree.flatten(arguments)
    leaves = [leaf if hasattr(leaf, "dtype") else np.asarray(leaf) for leaf in leaves]
    shapes = tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves)
    devices, config = tuple(jax.local_devices()), jax.config.values
    program = _program(
        function,
        treedef,
        shapes,
        tuple(sorted(constants.items())),
        (devices, config["jax_enable_x64"]),
        config["jax_compilation_cache_dir"],
    )
    if len(devices) > 1:
        # An exported program wants its inputs where it was traced to find them: everywhere.
        mesh = Mesh(np.asarray(devices), ("devices",))
        leaves = jax.device_put(leaves, NamedSharding(mesh, PartitionSpec()))
    return program(*leaves)


@cache
def _program(function, treedef, shapes, constants, settings, folder) -> Callable:
    """The compiled program, from the folder if it is there."""

    def flat(*leaves):
        return function(*jax.tree.unflatten(treedef, leaves), **dict(constants))

    request = repr((treedef, shapes, constants, settings))
    if not folder or " at 0x" in request:  # an address says nothing about the next process
        return jax.jit(flat)
    digest = hashlib.sha256(request.encode()).hexdigest()[:32]
    path = Path(folder) / f"{function.__module__}.{function.__qualname__}-{digest}.traced"
    # Missing, cut off, of another version, or no program at all: trace anew.
    with contextlib.suppress(Exception):
        content = path.read_bytes()
        if content[:_DIGEST_SIZE] == _origin():
            return jax.jit(export.deserialize(bytearray(content[_DIGEST_SIZE:])).call)
    program = export.export(jax.jit(flat))(*shapes)
    # A disk that is full or read-only costs the next start some seconds, nothing else.
    with contextlib.suppress(Exception), atomic_write(path, "wb") as file:
        file.write(_origin() + program.serialize())
    return jax.jit(program.call)


@cache
def _origin() -> bytes:
    """Digest of what programs are traced from, but for their arguments."""
    import jaxlib

    import jaxpf
    import scenes

    digest = hashlib.sha256(f"{jax.__version__} {jaxlib.__version__}".encode())
    for package in (jaxpf, scenes):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            digest.update(f"{path.relative_to(folder)}\0".encode() + path.read_bytes())
    return digest.digest()
