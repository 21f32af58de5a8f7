"""Single images as frames: sorts them by name and decodes them to RGB."""

import contextlib
import itertools
import os
import re
import statistics
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from jaxpf.contract.errors import Argument, InputError, import_extra

IMAGE_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
#: Share of pixels that change as edges and noise do, above which a picture is a photograph.
_OF_PHOTOGRAPH = 0.25
#: Number of images that are read to know the range of 16 bits.
_SAMPLED = 9
#: Bits that images of 16 bits may hold, and their highest values.
_WHITES = {8: 255, 12: 4095, 16: 65535}
#: Share of the range below which fewer than 64 of 256 grey levels would be left.
_LEAST_FILLED = 0.25


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
    if len(set(steps)) > 1 or 0 in steps:
        usual = statistics.mode(steps)
        place = next(place for place, step in enumerate(steps) if step == 0 or step != usual)
        raise InputError(
            f"in folder '{folder}', '{names[place + 1]}' follows '{names[place]}'; a number in a "
            "name is the frame's number, so add the missing frames, or rename or remove files"
        )
    if steps[0] == 1 and numbers[0] in (0, 1):
        return None
    way = f"from {numbers[0]} on" if steps[0] == 1 else f"in steps of {steps[0]}"
    return f"frames of '{folder}' are numbered {way}; they count as 0, 1, 2, ..."


def read_mask(path: Path) -> np.ndarray:
    """Read the object numbers of a mask, int ``[H, W]``; 0 is the background.

    A pixel's number is its palette index or its grey level of 8, 16 or 32 bits.  A mask of 8 bits
    with soft edges, such as a JPEG's, marks one object where it is brighter than half its maximum;
    a colour mask marks one object in any colour.
    """
    pillow = import_extra("PIL.Image", "masks need Pillow")
    check_single(path)
    try:
        with pillow.open(path) as image:
            is_indexed = image.mode == "P"
            is_deep = image.mode.startswith(("I", "F"))
            has_numbers = is_indexed or is_deep or image.mode in ("L", "1")
            values = np.array(image if has_numbers else image.convert("RGB"))
    except (OSError, ValueError):
        raise InputError(f"'{path}' is not a picture; replace or remove it.") from None
    if values.ndim == 3 and np.all(values == values[..., :1]):
        values = values[..., 0]
    if values.ndim == 3:
        return _of_one_colour(path, values)
    if is_indexed or is_deep:
        return values.astype(int)
    levels = values.astype(int)
    rough, most = _is_rough(levels), levels.max()
    if rough.mean() > _OF_PHOTOGRAPH:
        raise InputError(
            f"'{path}' is a photograph, whose grey levels change from pixel to pixel; give "
            "pictures that are 0 but on the target, without loss (PNG, not JPEG)."
        )
    is_lossy = path.suffix.lower() in (".jpg", ".jpeg")
    # Compression leaves noise near the ends of the range.
    middle = (levels > most / 10) & (levels < most * 0.9)
    between = middle if middle.any() else (levels > 0) & (levels < most)
    is_soft = between.any() and rough[between].mean() > 0.5
    return (2 * levels > most).astype(int) if is_lossy or is_soft else levels


def _is_rough(levels: np.ndarray) -> np.ndarray:
    """Which pixels change as those of soft edges and of noise do, bool ``[H, W]``.

    Numbers of objects cover areas.  At a soft edge a pixel lies between its neighbours to both
    sides, and in noise no neighbour is equal to it.
    """
    across = np.diff(np.pad(levels, ((0, 0), (1, 1)), mode="edge"), axis=1)
    along = np.diff(np.pad(levels, ((1, 1), (0, 0)), mode="edge"), axis=0)
    left, right, up, down = across[:, :-1], across[:, 1:], along[:-1], along[1:]
    is_alone = (left != 0) & (right != 0) & (up != 0) & (down != 0)
    return (left * right > 0) | (up * down > 0) | is_alone


def _of_one_colour(path: Path, values: np.ndarray) -> np.ndarray:
    colours = np.unique(values.reshape(-1, 3)[values.any(axis=-1).ravel()], axis=0)
    if len(colours) > 1:
        raise InputError(
            f"'{path}' has {len(colours)} colours; give a mask, not a photograph, and save several "
            "objects as an indexed or grey PNG, in which each has a number of its own."
        )
    return values.any(axis=-1).astype(int)


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


def pictures_in(folder: Path) -> list[Path]:
    """Return the images in a folder, in natural order, without hidden files."""
    images = (
        entry
        for entry in folder.iterdir()
        if entry.suffix.lower() in IMAGE_SUFFIXES and not entry.name.startswith(".")
    )
    return sorted(images, key=lambda entry: natural_order(entry.name))


class Levels(NamedTuple):
    """How values of 16 bits become 8: ``black`` becomes 0 and ``white`` 255.

    Attributes:
        black: values below it become 0, too.
        white: see ``is_limit``.
        is_limit: whether a value above ``white`` is refused; else it becomes 255.
        note: what the user should know, or None.
    """

    black: int = 0
    white: int = _WHITES[16]
    is_limit: bool = False
    note: str | None = None


def refuse_range(range: Sequence[int] | None, place: object) -> None:
    """Refuse a range of values for other than images of 16 bits."""
    if range is not None:
        raise _bad_range(
            range,
            f" works only with a folder of images of 16 bits, and '{place}' is none; leave it out.",
        )


def _bad_range(range: Sequence[int], why: str) -> InputError:
    return InputError(Argument("range", range, typed=",".join(map(str, range))), why)


def levels_of(files: Sequence[Path], range: Sequence[int] | None) -> Levels:
    """Return how images of 16 bits become 8, by default as their values suggest.

    Cameras store 8 and 12 bits in 16-bit images.  The images count as 8-bit or 12-bit if no pixel
    of some of them, spread evenly, is above 255 or 4095.  Where fewer than 64 of 256 grey levels
    would be left, as in images of thermal cameras, the range is that of the values, and if isolated
    pixels, which are often defects of the sensor, widen it as much, that of the others.

    Args:
        files: the images.
        range: black and white, if the user chooses them.
    """
    if range is not None:
        black, white = range
        if not 0 <= black < white <= _WHITES[16]:
            raise _bad_range(
                range, " must be two whole numbers from 0 to 65535, black before white."
            )
        if _decode(files[0]).dtype != np.uint16:
            refuse_range(range, files[0])
        return Levels(black, white)
    places = np.unique(np.linspace(0, len(files) - 1, _SAMPLED).astype(int))
    found = []
    for place in places:
        image = _decode(files[place])
        if image.dtype != np.uint16:
            break
        smooth = cv2.medianBlur(image, 3)
        found.append([image.min(), smooth.min(), image.max(), smooth.max()])
    if not np.any(found):
        return Levels()
    lowest, highest = np.min(found, axis=0)[:2].tolist(), np.max(found, axis=0)[2:].tolist()
    bits, limit = next((bits, most) for bits, most in _WHITES.items() if highest[0] <= most)
    black, white = 0, limit
    for low, high in zip(lowest, highest, strict=True):
        if 0 < high - low < _LEAST_FILLED * (white - black):
            black, white = low, high
    if (black, white) != (0, limit):
        note = (
            f"images of '{files[0].parent}' fill a small part of 16 bits, so black is {black} and "
            f"white is {white}; --range LOW,HIGH chooses others"
        )
        return Levels(black, white, note=note)
    if bits == 16:
        return Levels()
    note = f"no value in '{files[0]}' is above {white}, so its 16 bits count as {bits}"
    return Levels(white=white, is_limit=True, note=note)


def read_image(path: Path, levels: Levels) -> np.ndarray:
    """Decode one image to uint8 RGB [H, W, 3].

    Args:
        path: the file.
        levels: of a 16-bit image, see ``levels_of``.
    """
    image = _decode(path)
    if image.dtype == np.uint16:
        black, white = levels.black, levels.white
        if levels.is_limit and (highest := image.max()) > white:
            raise InputError(
                f"'{path}' has a value of {highest}, and the images before it have at most "
                f"{white}; save all with the same number of bits, or give their --range"
            )
        span, above = white - black, image.clip(black, white).astype(np.uint32) - black
        image = ((above * 255 + span // 2) // span).astype(np.uint8)
    return to_rgb(image, path)


def _decode(path: Path) -> np.ndarray:
    """Decode to BGR [H, W, 3] of 8 or 16 bits; alpha is dropped."""
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot read image '{path}': {reason}; check or remove it") from error
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


#: Standard error belongs to the whole process, so that one block at a time redirects it.
_lock = threading.Lock()


@contextlib.contextmanager
def quiet_opencv() -> Iterator[None]:
    """Discard what is printed to standard error in the block.

    The libraries that decode pictures print past OpenCV's log level, so the file descriptor is
    redirected; that holds for the process, so blocks are short, and one at a time.
    """
    with _lock:
        try:
            usual = os.dup(2)
        except OSError:  # there is no standard error
            yield
            return
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 2)
        os.close(nothing)
        try:
            yield
        finally:
            os.dup2(usual, 2)
            os.close(usual)
