"""Real animals: two clips with joints marked by hand (BADJA), and a fly.

The fly's joints are a network's predictions: what is measured there is agreement with a network.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.measures import points as measures
from jaxpf.papers.eskil2014.scenes import track
from jaxpf.papers.measuring.checkpoints import part
from jaxpf.papers.paper import reading_clips
from scenes import read_clip
from scenes.keypoints import read_keypoints
from scenes.landmarks import read_landmarks

CLIPS = ("badja_bear", "badja_cows", "sleap_fly_pair")
#: sigma_t, pixels.
SCALE = 5.0
#: Frames of the fly that are tracked; the BADJA clips are tracked to their last mark.
FLY_FRAMES = 150
#: A point is where it should be within this share of the body's length.
SHARES = (0.05, 0.1, 0.2)
#: Marks stand about every fifth frame: a recovery is judged at the first mark in view.
MARKS = 1


class Marked(NamedTuple):
    """A clip from the frame in which points start.

    Attributes:
        name: of the clip.
        frames: ``[T + 1, H, W, 3]`` uint8.
        names: of the P points.
        truth: ``[T + 1, P, 2]``, NaN where nothing is marked.
        visible: ``[T + 1, P]`` bool.
        marked: ``[T + 1]`` bool.
        left_out: points that are hidden at the start, or lie where another one does.
        length: the largest distance between two points at the start, pixels.
    """

    name: str
    frames: np.ndarray
    names: tuple[str, ...]
    truth: np.ndarray
    visible: np.ndarray
    marked: np.ndarray
    left_out: tuple[str, ...]
    length: float


def available(data: Path) -> list[Path]:
    """Folders of those clips that the folder of real clips holds.

    Raises:
        InputError: it holds none of them.
    """
    found = [data / name for name in CLIPS if (data / name).is_dir()]
    if not found:
        raise InputError(
            f"the folder '{data}' holds none of {', '.join(CLIPS)}; name one that does, or leave "
            "out --data."
        )
    return found


def read_all(data: Path, quick: bool = False) -> list[Marked]:
    """Read the clips that the folder of real clips holds, or the first of them."""
    folders = available(data)
    return [read(folder) for folder in (folders[:1] if quick else folders)]


def read(folder: Path) -> Marked:
    """Read a clip and its marks.

    Raises:
        InputError: it cannot be read, or fewer than two points are in view at the start.
    """
    with reading_clips():
        clip = read_clip(folder, boxes_needed=False)
        if folder.name == CLIPS[2]:
            keypoints = read_keypoints(folder)
            truth = keypoints.of(0, *keypoints.names)[: FLY_FRAMES + 1]
            visible = np.isfinite(truth).all(axis=-1)
            marked, names = visible.any(axis=1), keypoints.names
        else:
            marks = read_landmarks(folder)
            truth, visible, marked = marks.places, marks.visible, marks.marked
            names = tuple(str(number) for number in marks.ids)
        start, stop = int(np.argmax(marked)), len(marked)
        frames = np.stack(list(clip.frames(0, stop)))[start:]
    kept = visible[start] & ~_repeated(truth[start])
    if kept.sum() < 2:
        raise InputError(f"fewer than two points of '{folder}' are in view in frame {start}.")
    # A pixel's middle lies half a pixel from its number.
    truth = truth[start:, kept] + 0.5
    apart = np.linalg.norm(truth[0][:, None] - truth[0][None], axis=-1)
    return Marked(
        name=folder.name,
        frames=frames,
        names=tuple(name for name, keep in zip(names, kept, strict=True) if keep),
        truth=truth,
        visible=visible[start:, kept],
        marked=marked[start:],
        left_out=tuple(name for name, keep in zip(names, kept, strict=True) if not keep),
        length=float(apart.max()),
    )


def _repeated(places: np.ndarray) -> np.ndarray:
    """Which points ``[P]`` lie where an earlier one does, so that nothing tells them apart."""
    same = (places[:, None] == places[None]).all(axis=-1)
    return np.triu(same, 1).any(axis=0)


def measure(
    clip: Marked,
    runs: int,
    filters: Sequence[str],
    others: Sequence[str],
    report: Callable[[str], None],
) -> dict[str, np.ndarray]:
    """Method -> distances ``[R, T, P]`` in pixels, in the frames after the start."""
    report(f"  {clip.name}: {len(clip.names)} points, {len(clip.frames) - 1} frames")
    found = part(
        clip.name,
        lambda: track(clip.frames, clip.truth[0], SCALE, filters, others, runs, seed=0),
    )
    return {
        name: measures.point_distances(places, clip.truth[1:]) for name, places in found.items()
    }
