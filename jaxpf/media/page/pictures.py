"""Frames of a source as JPEG pictures, by number."""

import collections
import threading
from typing import TYPE_CHECKING, Any

import cv2

from jaxpf.contract.errors import InputError

if TYPE_CHECKING:
    import numpy as np


#: Number of pictures kept, and of frames decoded before one that is asked for out of order.
_KEPT, _BEFORE = 400, 40
#: Frames that are decoded and passed over rather than opening the source again.
_NEAR = 250


class Pictures:
    """Pictures of a source's frames, decoded on demand; recent ones are kept.

    Videos are decoded in order, because seeking lands on the wrong frame in many of them.
    """

    def __init__(self, source: Any):
        self.source = source
        self._kept: collections.OrderedDict[int, bytes] = collections.OrderedDict()
        self._reader: Any = None
        self._next = 0
        self._lock = threading.Lock()

    def jpeg(self, number: int) -> bytes:
        """The frame ``number``, from 0, as JPEG.

        Raises:
            InputError: there is no such frame.
        """
        with self._lock:
            if number in self._kept:
                self._kept.move_to_end(number)
                return self._kept[number]
            if self._reader is None or not self._next <= number <= self._next + _NEAR:
                self.close()
                self._next = max(number - _BEFORE, 0) if number < self._next else number
                self._reader = self.source.frames(self._next)
            while self._next <= number:
                frame = next(self._reader, None)
                if frame is None:
                    self._reader = None
                    raise InputError(f"'{self.source.path}' has no frame {number}.")
                self._keep(self._next, frame)
                self._next += 1
            return self._kept[number]

    def _keep(self, number: int, frame: "np.ndarray") -> None:
        self._kept[number] = cv2.imencode(".jpg", frame[..., ::-1])[1].tobytes()
        if len(self._kept) > _KEPT:
            self._kept.popitem(last=False)

    def close(self) -> None:
        """Release the source."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None
