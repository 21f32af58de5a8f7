"""Frames in chunks, so that memory does not grow with the length of a sequence."""

import itertools
from collections.abc import Iterable, Iterator, Sized
from typing import Any

import jax
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole, with_nan
from jaxpf.running.frames import Frames, num_frames

#: Default size of a chunk's frames, bytes.
CHUNK_BYTES = 64 * 2**20
#: Minimum number of frames per chunk and device: the compiler unrolls a loop with one iteration,
#: which may round differently.
_LEAST = 2


def chunk_length(num_frames: int | None, frame_bytes: int) -> int:
    """Number of frames per chunk that fits into ``CHUNK_BYTES``, at least two.

    Args:
        num_frames: length of the sequence, which is divided evenly; None if unknown.
        frame_bytes: size of one frame.
    """
    most = max(_LEAST, CHUNK_BYTES // max(frame_bytes, 1))
    if num_frames is None:
        return most
    return max(_LEAST, -(-num_frames // -(-num_frames // most)))


def in_chunks(frames: Frames, length: int | None, multiple: int) -> Iterator[tuple[int, int, Any]]:
    """Yield a sequence's frames in chunks.

    Args:
        frames: in NumPy or device arrays, or one by one.
        length: frames per chunk, rounded up to a multiple of ``multiple``.  None: as many as fit in
            ``CHUNK_BYTES``, or all frames if they are already on a device.
        multiple: the length of every chunk is a multiple of this.

    Yields:
        The number of the chunk's first frame, the number of frames without padding, and the
        frames.  All chunks have the same length, padded by repeating the last frame, unless there
        is only one chunk.

    Raises:
        InputError: no frame, or a frame that differs in shape from the first; ``length`` below 1.
    """
    if length is not None:
        check_whole("frames_per_chunk", length)
    if frames.source is not None:
        yield from _gathered(frames.source, length, multiple)
        return
    leaves, total = jax.tree.leaves(frames.whole), num_frames(frames.whole)
    if length is None and not all(isinstance(leaf, np.ndarray) for leaf in leaves):
        length = total
    elif length is None:
        length = chunk_length(total, sum(leaf.nbytes for leaf in leaves) // total)
    length = _rounded(length, multiple)
    for first in range(0, total, length):
        count = min(length, total - first)
        wanted = _filled_length(first, count, length, multiple)
        chunk = jax.tree.map(lambda x, i=first, n=count: x[i : i + n], frames.whole)
        if wanted > count:
            places = np.minimum(np.arange(wanted), count - 1)
            chunk = jax.tree.map(lambda x, places=places: x[places], chunk)
        yield first, count, chunk


def _gathered(frames: Iterable[Any], length: int | None, multiple: int) -> Iterator[Any]:
    """``in_chunks`` for single frames, which are written directly into the chunk's buffer."""
    source = iter(frames)
    start = next(source, None)
    if start is None:
        raise InputError("frames has no frame; give at least one.")
    leaves, structure = _leaves(start)
    kinds = [_kind(leaf) for leaf in leaves]
    if length is None:
        total = len(frames) if isinstance(frames, Sized) else None
        length = chunk_length(total, sum(leaf.nbytes for leaf in leaves))
    length = _rounded(length, multiple)
    rest = enumerate(itertools.chain([start], source))
    for first in itertools.count(0, length):
        arrays = [np.empty((length, *leaf.shape), leaf.dtype) for leaf in leaves]
        count = 0
        for number, frame in itertools.islice(rest, length):
            own, shape = _leaves(frame)
            own_kinds = [_kind(leaf) for leaf in own]
            if (own_kinds, shape) != (kinds, structure):
                raise InputError(
                    f"frame {number} is {', '.join(own_kinds)}, the first one {', '.join(kinds)}; "
                    "give frames that are all alike."
                )
            for array, leaf in zip(arrays, own, strict=True):
                array[count] = leaf
            count += 1
        if not count:
            return
        wanted = _filled_length(first, count, length, multiple)
        for array in arrays:
            array[count:wanted] = array[count - 1]
        yield first, count, jax.tree.unflatten(structure, [array[:wanted] for array in arrays])
        if count < length:
            return


def _leaves(frame: Any) -> tuple[list[np.ndarray], Any]:
    leaves, structure = jax.tree.flatten(frame)
    return [np.asarray(with_nan(leaf)) for leaf in leaves], structure


def _kind(leaf: np.ndarray) -> str:
    return f"{jax.dtypes.canonicalize_dtype(leaf.dtype)} {list(leaf.shape)}"


def _rounded(length: int, multiple: int) -> int:
    return -(-max(length, _LEAST * multiple) // multiple) * multiple


def _filled_length(first: int, count: int, length: int, multiple: int) -> int:
    """Padded length of a chunk: the common length, unless there is only one chunk."""
    return length if first else -(-count // multiple) * multiple
