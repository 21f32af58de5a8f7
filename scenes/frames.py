"""Pictures of a sequence too long for memory, read on demand."""

import math
import operator
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from scenes.scene import SceneError

#: Maximum number of pictures to skip before seeking anew.
_SKIPPED = 16


class LazyFrames:
    """Frames ``[T, H, W, 3]`` uint8, RGB, of a recorded sequence, decoded on demand.

    Iterating yields one picture after another and keeps none, which suits long sequences.  An
    integer index reads that picture; a slice returns lazy frames and reads nothing.  Other array
    indices and ``np.asarray`` return an array.

    Attributes:
        shape: (T, H, W, 3).
        dtype: uint8.
        ndim: 4.
        nbytes: size of all frames in memory.
    """

    dtype = np.dtype(np.uint8)
    ndim = 4

    def __init__(
        self,
        clip: Any,
        numbers: Sequence[int],
        fault: Callable[[SceneError], Exception] | None = None,
    ):
        """Read nothing yet.

        Args:
            clip: a ``scenes.Clip``.
            numbers: of its frames, ascending.
            fault: converts the ``SceneError`` of an unreadable picture to the error to raise.
        """
        self.clip, self.numbers, self.fault = clip, numbers, fault
        self.shape = (len(numbers), clip.height, clip.width, 3)
        self.nbytes = math.prod(self.shape)
        # Keep the video open, so that consecutive indices do not decode it from the beginning.
        self._lock = threading.Lock()
        self._reading = self._at_end()

    def __reduce__(self) -> tuple[Any, ...]:
        return LazyFrames, (self.clip, self.numbers, self.fault)

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[np.ndarray]:
        try:
            yield from self.clip.pictures(self.numbers)
        except SceneError as error:
            raise (self.fault(error) if self.fault else error) from None

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        frames = np.empty(self.shape, self.dtype)
        for place, picture in enumerate(self):
            frames[place] = picture
        return frames if dtype is None else frames.astype(dtype, copy=False)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            numbers = self.numbers[index]
            is_ascending = index.step is None or index.step > 0
            return self._of(numbers) if is_ascending else np.asarray(self._of(numbers[::-1]))[::-1]
        if isinstance(index, tuple) and index and isinstance(index[0], slice):
            return np.asarray(self[index[0]])[:, *index[1:]]
        if isinstance(index, tuple) and index and isinstance(index[0], int | np.integer):
            return self[index[0]][index[1:]]
        if isinstance(index, int | np.integer) and not isinstance(index, bool):
            return self._picture(range(len(self))[operator.index(index)])
        if isinstance(index, list | np.ndarray) and np.ndim(index) == 1:
            places = np.arange(len(self))[index]
            kept, back = np.unique(places, return_inverse=True)
            return np.asarray(self._of([self.numbers[place] for place in kept]))[back]
        return np.asarray(self)[index]

    def with_fault(self, fault: Callable[[SceneError], Exception]) -> "LazyFrames":
        """Return the same frames, which raise ``fault(error)`` instead of a ``SceneError``."""
        return LazyFrames(self.clip, self.numbers, fault)

    def _of(self, numbers: Sequence[int]) -> "LazyFrames":
        return LazyFrames(self.clip, numbers, self.fault)

    def _picture(self, place: int) -> np.ndarray:
        with self._lock:
            next_place, pictures = self._reading
            self._reading = self._at_end()  # in case of an error below
            if not 0 <= place - next_place <= _SKIPPED:
                next_place, pictures = place, iter(self._of(self.numbers[place:]))
            for _ in range(place - next_place):
                next(pictures)
            picture = next(pictures)
            self._reading = place + 1, pictures
            return picture

    def _at_end(self) -> tuple[int, Iterator[np.ndarray]]:
        return len(self), iter(())
