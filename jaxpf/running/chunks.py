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

    The length of the sequence, unless it is unknown (None), is divided evenly.
    """
    most = max(_LEAST, CHUNK_BYTES // max(frame_bytes, 1))
    if num_frames is None:
        return most
    return max(_LEAST, -(-num_frames // -(-num_frames // most)))


def in_chunks(frames: Frames, length: int | None, multiple: int) -> Iterator[tuple[int, int, Any]]:
    """Yield a sequence's frames in chunks.

    Chunks have ``length`` frames, rounded up to a multiple of ``multiple``; by default as many as
    fit in ``CHUNK_BYTES``, or all frames if they are already on a device.

    Yields:
        The number of the chunk's first frame, the number of frames without padding, and the
        frames.  All chunks have the same length, padded by repeating the last frame, unless there
        is only one chunk.
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
    """``in_chunks`` for single frames."""
    source = _copied(frames)
    rows = list(itertools.islice(source, 1))
    if not rows:
        raise InputError("frames has no frame; give at least one.")
    if length is None:
        total = len(frames) if isinstance(frames, Sized) else None
        length = chunk_length(total, sum(leaf.nbytes for leaf in jax.tree.leaves(rows)))
    length, first = _rounded(length, multiple), 0
    while rows:
        rows += itertools.islice(source, length - len(rows))
        count = len(rows)
        rows += rows[-1:] * (_filled_length(first, count, length, multiple) - count)
        yield first, count, jax.tree.map(lambda *leaves: np.stack(leaves), *rows)
        first, rows = first + length, list(itertools.islice(source, 1))


def _copied(frames: Iterable[Any]) -> Iterator[Any]:
    """The arrays of frames, copied, as a camera may overwrite them; refuse frames unlike the first.

    Another dtype or, in a later chunk, another shape would be broadcast without a word.
    """
    wanted: Any = None
    for number, frame in enumerate(frames):
        copied = jax.tree.map(lambda leaf: np.array(with_nan(leaf)), frame)
        kind = jax.tree.map(
            lambda leaf: f"{jax.dtypes.canonicalize_dtype(leaf.dtype)} {list(leaf.shape)}", copied
        )
        wanted = wanted if number else kind
        if kind != wanted:
            raise InputError(
                f"frame {number} is {kind}, the first one {wanted}; give frames that are all alike."
            )
        yield copied


def _rounded(length: int, multiple: int) -> int:
    return -(-max(length, _LEAST * multiple) // multiple) * multiple


def _filled_length(first: int, count: int, length: int, multiple: int) -> int:
    """Padded length of a chunk: the common length, unless there is only one chunk."""
    return length if first else -(-count // multiple) * multiple
