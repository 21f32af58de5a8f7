"""Frames of a recorded sequence, read on demand."""

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from jaxpf.contract.errors import InputError
from jaxpf.media.film import FrameSource
from jaxpf.media.read import open_frames, open_pictures


class Frames:
    """Frames ``[T, H, W, 3]`` uint8, RGB, of a video or of pictures, decoded on demand.

    Iterating yields one picture after another and keeps none, which suits long sequences.  A slice
    returns lazy frames and reads nothing; other indices and ``np.asarray`` return an array.

    Attributes:
        place: the video, or the pictures in order.
        numbers: of the frames in it, ascending.
        shape: (T, H, W, 3).
        dtype: uint8.
        ndim: 4.
        nbytes: size of all frames in memory.
    """

    dtype = np.dtype(np.uint8)
    ndim = 4

    def __init__(
        self,
        place: Path | tuple[Path, ...],
        numbers: Sequence[int] | None = None,
        source: FrameSource | None = None,
    ):
        """Open the video or the pictures, and decode the first one.

        Args:
            place: the video, or the pictures in order.
            numbers: by default those of all frames, if their number is known.
            source: the same place, opened.
        """
        open_place: Any = open_frames if isinstance(place, Path) else open_pictures
        self._source = source or open_place(place)
        if numbers is None:
            numbers = range(self._source.num_frames or self._source.frames_expected or 0)
        self.place, self.numbers = place, numbers
        self.shape = (len(numbers), self._source.height, self._source.width, 3)
        self.nbytes = math.prod(self.shape)

    def __reduce__(self) -> tuple[Any, ...]:
        return Frames, (self.place, self.numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[np.ndarray]:
        if not isinstance(self.place, Path):
            yield from (next(self._source.frames(number)) for number in self.numbers)
        elif len(self):
            position = self.numbers[0]
            pictures = self._source.frames(position)
            for number in self.numbers:
                picture = next(itertools.islice(pictures, number - position, None), None)
                if picture is None:
                    raise InputError(
                        f"'{self.place}' ends before frame {number}; correct the number of frames "
                        "in the sequence's description"
                    )
                position = number + 1
                yield picture

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        frames = np.empty(self.shape, self.dtype)
        for place, picture in enumerate(self):
            frames[place] = picture
        return frames if dtype is None else frames.astype(dtype, copy=False)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice) and (index.step is None or index.step > 0):
            return self._of(self.numbers[index])
        first, *rest = index if isinstance(index, tuple) else (index,)
        if first is Ellipsis or (rest and not isinstance(first, int | np.integer | slice)):
            return np.asarray(self)[index]
        places = np.arange(len(self))[first]
        kept, back = np.unique(places, return_inverse=True)
        pictures = np.asarray(self._of([self.numbers[place] for place in kept]))
        return pictures[back.reshape(places.shape)][(slice(None),) * places.ndim + tuple(rest)]

    def _of(self, numbers: Sequence[int]) -> "Frames":
        return Frames(self.place, numbers, self._source)
