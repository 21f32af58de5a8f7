"""Single images as frames: sorts them by name and decodes them to RGB."""

import contextlib
import itertools
import re
import statistics
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.media.quiet import quiet_opencv

IMAGE_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
#: Maximum number of values in a mask; more than ``_SOFT`` grey levels up to a value above the
#: maximum are soft edges.
_MOST_VALUES, _SOFT = 64, 16
#: Number of images that are read to know the range of 16 bits.
_SAMPLED = 9
VIDEO_SUFFIXES = (".avi", ".mkv", ".mov", ".mp4", ".webm", ".wmv")


def frame_numbers(names: Sequence[str]) -> list[int | None]:
    """Return the frame number in the name of every file of a folder; None where there is none.

    It is the number at the end of the stem, 12 for ``a012.png``.  If the stems differ in their
    numbers only, it is the last number that differs in all: 12 for ``0012_cam1.png``.
    """
    stems = [re.split(r"(\d+)", Path(name).stem) for name in names]
    if len({tuple(stem[::2]) for stem in stems}) == 1:
        columns = [[int(stem[place]) for stem in stems] for place in range(1, len(stems[0]), 2)]
        for column in reversed(columns):
            if len(set(column)) == len(names) and (len(names) > 1 or len(columns) == 1):
                return list(column)
    return [int(stem[-2]) if len(stem) > 1 and not stem[-1] else None for stem in stems]


def check_consecutive(folder: Path, names: Sequence[str]) -> str | None:
    """Check that numbered files skip no frame, since the number identifies the frame.

    Args:
        folder: for messages.
        names: of the files, in order.

    Returns:
        A note if the numbers begin after 1 or have a step other than 1, or a file has none.
    """
    given = frame_numbers(names)
    numbers = [number for number in given if number is not None]
    if len(names) < 3 or len(set(numbers)) < 2:
        return None
    if len(numbers) < len(names):
        place = given.index(None)
        return f"'{names[place]}' in folder '{folder}' has no number; it counts as frame {place}"
    steps = [after - before for before, after in itertools.pairwise(numbers)]
    if 0 in steps:
        place = steps.index(0)
        raise InputError(
            f"folder '{folder}' has two files of number {numbers[place]}, '{names[place]}' and "
            f"'{names[place + 1]}'; a number in a name is the frame's number, so remove or rename "
            "one"
        )
    if len(set(steps)) > 1:
        usual = statistics.mode(steps)
        place = next(place for place, step in enumerate(steps) if step != usual)
        earlier, later = names[place : place + 2]
        missing = range(numbers[place] + usual, numbers[place + 1], usual)
        listed = (
            f"{missing[0]} to {missing[-1]}" if len(missing) > 1 else "".join(map(str, missing))
        )
        lacks = f"has no frame {listed}" if missing else "is numbered unevenly"
        raise InputError(
            f"folder '{folder}' {lacks}: '{later}' follows '{earlier}'; a number in a name is the "
            "frame's number, so add the missing frames, or rename the files if these frames follow "
            "one another"
        )
    if steps[0] == 1 and numbers[0] in (0, 1):
        return None
    way = f"from {numbers[0]} on" if steps[0] == 1 else f"in steps of {steps[0]}"
    return f"frames of '{folder}' are numbered {way}; they count as 0, 1, 2, ..."


def read_mask(path: Path) -> np.ndarray:
    """Read the object numbers of a mask, int ``[H, W]``; 0 is the background.

    A pixel's number is its palette index or grey level.  A grey mask with soft edges, such as a
    JPEG's, marks one object where it is brighter than half its maximum; a colour mask marks one
    object in any colour.
    """
    try:
        from PIL import Image, UnidentifiedImageError
    except ModuleNotFoundError:
        raise InputError("masks need Pillow, which is missing; pip install 'jaxpf[cli]'.") from None
    check_single(path)
    try:
        with Image.open(path) as image:
            is_indexed = image.mode == "P"
            has_numbers = image.mode in ("P", "L", "1", "I;16", "I")
            values = np.array(image if has_numbers else image.convert("RGB"))
    except (OSError, UnidentifiedImageError, ValueError):
        raise InputError(f"'{path}' is not a picture; replace or remove it.") from None
    _check_mask(path, values)
    if values.ndim == 2:
        levels = values.astype(int)
        is_soft = len(np.unique(levels)) > _SOFT and levels.max() > _MOST_VALUES
        is_soft |= path.suffix.lower() in (".jpg", ".jpeg")
        return (2 * levels > levels.max()).astype(int) if is_soft and not is_indexed else levels
    if np.all(values == values[..., :1]):
        return values[..., 0].astype(int)
    colours = np.unique(values.reshape(-1, 3), axis=0)
    colours = colours[colours.any(axis=1)]
    if len(colours) > 1:
        shown = ", ".join("#" + "".join(f"{part:02x}" for part in colour) for colour in colours[:6])
        raise InputError(
            f"'{path}' marks objects by {len(colours)} colours ({shown}); save it as an indexed or "
            "grey PNG, in which every object has a number of its own."
        )
    return values.any(axis=-1).astype(int)


def _check_mask(path: Path, values: np.ndarray) -> None:
    """Refuse photographs: a mask has few distinct values."""
    count = len(np.unique(values.reshape(values.shape[0] * values.shape[1], -1), axis=0))
    if count > _MOST_VALUES:
        kind = "grey levels" if values.ndim == 2 else "colours"
        raise InputError(
            f"'{path}' holds {count} {kind}, as a photograph does, and a mask has few; give "
            "pictures that are 0 but on the target, without loss (PNG, not JPEG)."
        )


def check_name(path: Path) -> None:
    """Refuse a name that is not UTF-8, at which OpenCV crashes."""
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError:
        raise InputError(f"the name {str(path.absolute())!a} is not UTF-8; rename it") from None


def natural_order(name: str) -> tuple[list[str | int], str]:
    """Return a sort key that compares runs of digits as numbers: ``a2`` before ``a10``."""
    parts = re.split(r"([0-9]+)", name.lower())
    # Text and digits alternate, so that only values of one type are compared.
    return [int(part) if index % 2 else part for index, part in enumerate(parts)], name


def frames_inside(folder: Path) -> Path | None:
    """Return a video or a folder of images inside ``folder``, or None."""
    for entry in sorted(folder.iterdir()):
        holds_images = entry.is_dir() and any(
            inner.suffix.lower() in IMAGE_SUFFIXES for inner in entry.iterdir()
        )
        if holds_images or entry.suffix.lower() in VIDEO_SUFFIXES:
            return entry
    return None


def full_range(files: Sequence[Path]) -> int:
    """Return the value of white in images of 16 bits: 65535, or 4095 for 12-bit data.

    Cameras store 12 bits in 16-bit images.  The images count as 12-bit if no pixel of some of
    them, spread evenly, is above 4095.
    """
    places = np.unique(np.linspace(0, len(files) - 1, _SAMPLED).astype(int))
    highest = 0
    for place in places:
        image = _decode(files[place])
        if image.dtype != np.uint16:
            break
        highest = max(highest, int(image.max()))
    return 4095 if 255 < highest <= 4095 else 65535


def read_image(path: Path, most: int = 65535) -> np.ndarray:
    """Decode one image to uint8 RGB [H, W, 3].

    Args:
        path: the file.
        most: value of white in a 16-bit image, see ``full_range``; a higher value is refused.
    """
    image = _decode(path)
    if image.dtype == np.uint16:
        if (highest := image.max()) > most:
            raise InputError(
                f"'{path}' has a value of {highest}, and the images before it are of 12 bits, at "
                f"most {most}; save all with the same number of bits"
            )
        image = ((image.astype(np.uint32) * 255 + most // 2) // most).astype(np.uint8)
    return to_rgb(image, path)


def _decode(path: Path) -> np.ndarray:
    """Decode to BGR [H, W, 3] of 8 or 16 bits; alpha is dropped."""
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot read image '{path}': {reason}; remove it") from error
    image = None
    if data:
        flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
        with quiet_opencv(), contextlib.suppress(cv2.error):  # as if beyond 2^30 pixels
            image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if image is None:
        wrong = "damaged, too large (2^30 pixels), of 32 bits per channel, or not an image"
        state = wrong if data else "empty (0 bytes)"
        raise InputError(f"image '{path}' cannot be decoded: it is {state}; replace or remove it")
    return image


def check_single(path: Path) -> None:
    """Refuse a TIFF or WebP file with several pictures, of which OpenCV would read only one."""
    if path.suffix.lower() in (".tif", ".tiff", ".webp"):
        with quiet_opencv():
            count = cv2.imcount(str(path))
        if count > 1:
            raise InputError(
                f"'{path}' holds {count} pictures; split it into files of their own, as by "
                f"`magick '{path.name}' -coalesce frames/%04d.png`, and give their folder"
            )


def to_rgb(image: np.ndarray, path: Path | str) -> np.ndarray:
    """Convert OpenCV's BGR [H, W, 3] or grey [H, W] of 8 bits to uint8 RGB [H, W, 3].

    ``path`` names the image in messages.
    """
    if image.dtype != np.uint8:
        raise InputError(
            f"'{path}' holds {image.dtype} pixels; convert it to 8 or 16 bits per channel"
        )
    code = cv2.COLOR_GRAY2RGB if image.ndim == 2 else cv2.COLOR_BGR2RGB
    return cv2.cvtColor(image, code)
