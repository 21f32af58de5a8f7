"""Single images as frames: finding their order, decoding them to RGB."""

import re
from pathlib import Path

import cv2
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.media.quiet import quiet_opencv

IMAGE_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
VIDEO_SUFFIXES = (".avi", ".mkv", ".mov", ".mp4", ".webm", ".wmv")


def natural_order(name: str) -> tuple[list[str | int], str]:
    """Sort key that compares runs of digits as numbers: ``a2`` before ``a10``."""
    parts = re.split(r"([0-9]+)", name.lower())
    # Text and digits alternate, so that like is always compared with like.
    return [int(part) if index % 2 else part for index, part in enumerate(parts)], name


def frames_inside(folder: Path) -> Path | None:
    """A video or a folder of images inside ``folder``, if there is one."""
    for entry in sorted(folder.iterdir()):
        holds_images = entry.is_dir() and any(
            inner.suffix.lower() in IMAGE_SUFFIXES for inner in entry.iterdir()
        )
        if holds_images or entry.suffix.lower() in VIDEO_SUFFIXES:
            return entry
    return None


def read_image(path: Path) -> np.ndarray:
    """Decode one image to uint8 RGB [H, W, 3].

    Raises:
        InputError: it cannot be read or decoded, or has another depth than 8 or 16 bits.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read image '{path}': {error.strerror}; remove it") from error
    image = None
    if data:
        with quiet_opencv():
            image = cv2.imdecode(
                np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
            )
    if image is None:
        state = "damaged or not an image" if data else "empty (0 bytes)"
        raise InputError(f"image '{path}' cannot be decoded: it is {state}; replace or remove it")
    return to_rgb(image, path)


def to_rgb(image: np.ndarray, path: Path | str) -> np.ndarray:
    """From OpenCV's BGR [H, W, 3] or grey [H, W], 8 or 16 bits, to uint8 RGB [H, W, 3].

    Raises:
        InputError: another depth; ``path`` is named.
    """
    if image.dtype == np.uint16:
        image = ((image.astype(np.uint32) * 255 + 32767) // 65535).astype(np.uint8)
    if image.dtype != np.uint8:
        raise InputError(
            f"'{path}' holds {image.dtype} pixels; convert it to 8 or 16 bits per channel"
        )
    code = cv2.COLOR_GRAY2RGB if image.ndim == 2 else cv2.COLOR_BGR2RGB
    return cv2.cvtColor(image, code)
