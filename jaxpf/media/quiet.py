"""Keeps OpenCV and FFmpeg from printing: jaxpf reports problems in its own messages."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

_FFMPEG_LEVEL = "OPENCV_FFMPEG_LOGLEVEL"
_AV_LOG_QUIET = "-8"
# OpenCV 5 moved the log level functions of OpenCV 4.
_logging = cv2 if hasattr(cv2, "setLogLevel") else cv2.utils.logging
_SILENT = 0
_lock = threading.Lock()
_inside = 0
_level_before = 0
_environment_set = False


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """Silence OpenCV within the block, then restore the log level and the environment.

    OpenCV reads FFmpeg's level from the environment once per process, at the first video it
    opens.  A level set by the user stays in force.  Blocks may nest and overlap across threads:
    the first to enter saves the settings, the last to leave restores them.
    """
    global _inside, _level_before, _environment_set
    with _lock:
        if _inside == 0:
            _level_before = _logging.getLogLevel()
            _logging.setLogLevel(_SILENT)
            _environment_set = _FFMPEG_LEVEL not in os.environ
            if _environment_set:
                os.environ[_FFMPEG_LEVEL] = _AV_LOG_QUIET
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _logging.setLogLevel(_level_before)
                if _environment_set:
                    os.environ.pop(_FFMPEG_LEVEL, None)
