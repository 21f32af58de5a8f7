"""Keep OpenCV and FFmpeg from printing: problems are reported in jaxpf's own sentences."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

_FFMPEG_LEVEL = "OPENCV_FFMPEG_LOGLEVEL"
_AV_LOG_QUIET = "-8"
# OpenCV 5 moved the functions of OpenCV 4 that set the log level.
_logging = cv2 if hasattr(cv2, "setLogLevel") else cv2.utils.logging
_SILENT = 0
_lock = threading.Lock()
_inside = 0
_level_before = 0
_environment_set = False


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """Silence OpenCV within the block; the log level and the environment are put back.

    OpenCV reads FFmpeg's level from the environment once per process, at the first video it
    opens.  A level that the user has set stays in force.  Blocks may nest and may overlap in
    several threads: the first to enter saves, the last to leave restores.
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
