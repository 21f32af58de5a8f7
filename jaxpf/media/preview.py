"""A window that shows frames while they are processed, if there is a display.

It uses Tk, which comes with Python.  OpenCV's windows need a package other than the headless one,
and the two packages overwrite each other's files.
"""

import time
from typing import Any

import cv2
import numpy as np

from jaxpf.contract.errors import InputError

#: Minimum seconds between two pictures: a higher rate is not visible and costs time.
_INTERVAL = 1 / 30
#: Maximum size of the window as a share of the screen's width and height.
_SHARE = 0.9


class Preview:
    """A preview window; closing it stops the preview but not the work."""

    def __init__(self, title: str):
        """Open the window.

        Raises:
            InputError: there is no display, or Tk is missing.
        """
        try:
            import tkinter
        except ModuleNotFoundError:
            raise InputError(
                "a preview needs Tk, which this Python lacks; install it (python3-tk on Debian and "
                "Ubuntu), or leave --preview out"
            ) from None
        try:
            self._root = tkinter.Tk()
        except tkinter.TclError as error:
            raise InputError(
                f"a preview needs a screen, and there is none here ({error}); leave --preview out"
            ) from None
        self._root.title(title)
        self._root.protocol("WM_DELETE_WINDOW", self.close)
        self._photo = tkinter.PhotoImage(master=self._root)
        tkinter.Label(self._root, image=self._photo, borderwidth=0).pack()
        self._most = _SHARE * np.array(
            [self._root.winfo_screenwidth(), self._root.winfo_screenheight()]
        )
        self._shown_at = -np.inf
        self.is_open = True

    @property
    def is_due(self) -> bool:
        """Whether the window is open and the last picture has been shown for long enough."""
        return self.is_open and time.monotonic() - self._shown_at >= _INTERVAL

    def show(self, picture: np.ndarray) -> None:
        """Show a picture, uint8 RGB [H, W, 3], reduced if the screen is smaller."""
        if not self.is_open:
            return
        height, width = picture.shape[:2]
        factor = float(np.min(self._most / (width, height)))
        if factor < 1:
            size = max(1, int(factor * width)), max(1, int(factor * height))
            picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
            height, width = picture.shape[:2]
        header = f"P6 {width} {height} 255 ".encode("ascii")
        self._photo.configure(data=header + picture.tobytes(), format="ppm")
        self._root.update()
        self._shown_at = time.monotonic()

    def close(self) -> None:
        """Close the window; further calls do nothing."""
        if self.is_open:
            self.is_open = False
            self._root.destroy()

    def __enter__(self) -> "Preview":
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()
