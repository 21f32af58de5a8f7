"""The times of a film's frames, from the frames' own time stamps."""

from array import array

import numpy as np

#: A time stamp that is earlier than the previous one by more than this many frame periods begins
#: another count, as where films are joined; by less, the stamps are out of order.
_RESTART = 2
#: A step this many times the median is a pause, or a frame is missing.
_PAUSE = 1.75
#: Number of latest steps whose median is the frame period.
_LATEST = 100


class Clock:
    """Times of frames in seconds after the first; each is later than the one before.

    A missing, repeated or earlier time stamp counts as one frame period; pauses are kept.
    """

    def __init__(self, rate: float):
        """Begin; ``rate`` in frames per second holds until time stamps show another one."""
        self._rate = rate
        self._times = array("d")  # 8 bytes a frame
        self._stamp = self._offset = 0.0

    def add(self, stamp: float | None) -> None:
        """Add the next frame and its time stamp in seconds, None if it has none."""
        if not self._times:
            self._stamp = stamp or 0.0
            self._offset = -self._stamp
            self._times.append(0.0)
            return
        latest, time = self._times[-1], None if stamp is None else stamp + self._offset
        if time is None or time <= latest:
            time = latest + self._period()
        if stamp is not None:
            if self._stamp - stamp > 0 and self._stamp - stamp > _RESTART * self._period():
                self._offset = time - stamp
            self._stamp = stamp
        self._times.append(time)

    def __getitem__(self, number: int) -> float:
        return self._times[number]

    def __len__(self) -> int:
        return len(self._times)

    @property
    def rate(self) -> float:
        """Frames per second: one over the mean of the steps, without pauses."""
        steps = np.diff(self._times)
        if not len(steps):
            return self._rate
        return float(1 / steps[steps < _PAUSE * np.median(steps)].mean())

    def _period(self) -> float:
        steps = np.diff(self._times[-_LATEST:])
        return float(np.median(steps)) if len(steps) else 1 / self._rate
