"""Programs kept on disk as traced, so that a command's next start need not trace them again.

JAX's compile cache keeps what XLA made of a program, but knows it only by the traced and lowered
program, and to trace and lower a filter takes longer than all the rest of a second start.  So a
command that runs one program again and again keeps that, too (``jax.export``), beside the
compile cache.  A kept program is used only where everything that it was traced from is the same:
this package's source text, JAX's version and the settings that tracing depends on, the devices,
and the shapes and static parts of the arguments.
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

#: JAX's settings on which a traced program depends.
_SETTINGS = (
    "jax_enable_x64",
    "jax_threefry_partitionable",
    "jax_default_prng_impl",
    "jax_default_matmul_precision",
    "jax_numpy_dtype_promotion",
    "jax_numpy_rank_promotion",
    "jax_random_seed_offset",
)
#: Where all code is known that a program may be traced from.
_KNOWN = ("builtins", "collections", "jax", "jaxpf", "scenes")


def run_exported(function: Callable, *arguments: Any, **constants: Any) -> Any:
    """``jax.jit(function)(*arguments)``, traced once per machine and shape of the arguments.

    Traced once per process, as ``jax.jit`` does, where there is no folder for JAX's compile
    cache, where an argument is of a class that somebody else wrote and may change, and where
    JAX cannot export the program.

    Args:
        function: pure, of this package, and calling no code but its own, JAX's and NumPy's.
            It returns tuples, lists and dictionaries of arrays.
        arguments: pytrees of arrays.
        constants: what the program is made for; hashable, with a ``repr`` that tells all.
    """
    leaves, treedef = jax.tree.flatten(arguments)
    leaves = [leaf if hasattr(leaf, "dtype") else np.asarray(leaf) for leaf in leaves]
    values = jax.config.values
    program = _program(
        function,
        treedef,
        tuple(jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves),
        tuple(sorted(constants.items())),
        (tuple(jax.local_devices()), *(values.get(name) for name in _SETTINGS)),
        values["jax_compilation_cache_dir"],
    )
    return program(*leaves)


@cache
def _program(function, treedef, shapes, constants, settings, folder) -> Callable:
    """The compiled program, from the folder if it is there."""

    def flat(*leaves):
        return function(*jax.tree.unflatten(treedef, leaves), **dict(constants))

    request = repr((treedef, shapes, constants, settings))
    # An address says nothing about the next process.
    if not folder or " at 0x" in request or not _is_known(treedef):
        return jax.jit(flat)
    name = f"{function.__module__}.{function.__qualname__}"
    origin = hashlib.sha256(f"{name} {request}".encode() + _sources()).digest()
    path = Path(folder) / f"{name}-{hashlib.sha256(request.encode()).hexdigest()[:32]}.traced"
    # Missing, damaged, of other sources: trace anew.
    with contextlib.suppress(Exception):
        content = path.read_bytes()
        seal, serialized = content[: len(origin)], content[len(origin) :]
        if seal == hashlib.sha256(origin + serialized).digest():
            return _callable(export.deserialize(bytearray(serialized)))
    try:
        program = export.export(jax.jit(flat))(*shapes)
        serialized = bytes(program.serialize())
    except Exception:  # a callback into Python, an operation without a stable form, ...
        return jax.jit(flat)
    # A disk that is full or read-only costs the next start some seconds, nothing else.
    with contextlib.suppress(Exception), atomic_write(path, "wb") as file:
        file.write(hashlib.sha256(origin + serialized).digest() + serialized)
    return _callable(program)


def _callable(program: export.Exported) -> Callable:
    """An exported program wants its inputs on all the devices that it was traced for."""
    run = jax.jit(program.call)
    if program.nr_devices == 1:
        return run
    mesh = Mesh(np.asarray(jax.local_devices()[: program.nr_devices]), ("devices",))
    return lambda *leaves: run(*jax.device_put(leaves, NamedSharding(mesh, PartitionSpec())))


def _is_known(treedef: Any) -> bool:
    """Whether all classes in a structure are this package's, or everybody's."""
    data = treedef.node_data()
    own = data is None or data[0].__module__.partition(".")[0] in _KNOWN
    return own and all(map(_is_known, treedef.children()))


@cache
def _sources() -> bytes:
    """Digest of the code that programs are traced from."""
    import jaxlib

    import jaxpf
    import scenes

    digest = hashlib.sha256(f"{jax.__version__} {jaxlib.__version__}".encode())
    for package in (jaxpf, scenes):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            digest.update(f"{path.relative_to(folder)}\0".encode() + path.read_bytes())
    return digest.digest()
