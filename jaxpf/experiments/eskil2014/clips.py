"""Real animals: two clips with joints marked by hand (BADJA), and a fly.

The fly's joints are a network's predictions: what is measured there is agreement with a network.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxpf.errors import InputError
from jaxpf.experiments.claims import Measured, student_interval, wilson
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.eskil2014 import methods
from jaxpf.experiments.eskil2014.tracking import track
from jaxpf.experiments.parts import part
from jaxpf.measures import points as measures
from scenes import SceneError, read_clip
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
_MARKS = 1


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


def read(folder: Path) -> Marked:
    """Read a clip and its marks.

    Raises:
        InputError: it cannot be read, or fewer than two points are in view at the start.
    """
    try:
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
    except SceneError as error:
        raise InputError(f"{error}.") from error
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
    clip: Marked, runs: int, quick: bool, report: Callable[[str], None]
) -> dict[str, np.ndarray]:
    """Method -> distances ``[R, T, P]`` in pixels, in the frames after the start."""
    filters = methods.QUICK if quick else methods.FILTERS
    others = methods.OTHERS[1:] if quick else methods.OTHERS
    report(f"  {clip.name}: {len(clip.names)} points, {len(clip.frames) - 1} frames")
    found = part(
        clip.name,
        lambda: track(clip.frames, clip.truth[0], SCALE, filters, others, runs, seed=0),
    )
    return {name: measures.distances(places, clip.truth[1:]) for name, places in found.items()}


def table(clip: Marked, found: dict[str, np.ndarray]) -> Table:
    """Errors, correct points and recoveries of every method on one clip."""
    visible, marked = clip.visible[1:], clip.marked[1:]
    hidden = marked[:, None] & ~visible
    back = measures.recoveries(clip.visible[clip.marked])
    rows = []
    for method, distance in found.items():
        cells: list[Cell | str] = [
            _cell(measures.mean_error(distance, visible), 1),
            _cell(measures.mean_error(distance, hidden), 1),
        ]
        for share in SHARES:
            within = measures.share_within(distance, share * clip.length, visible)
            cells.append(_cell(100 * within, 0))
        cells.append(_recovered(clip, distance))
        rows.append((method, cells))
    listed = ", ".join(f"{clip.names[point]} (mark {at})" for point, _, at in back) or "none"
    left_out = (
        f"  Hidden at the start, or where another is, and left out: {', '.join(clip.left_out)}."
        * bool(clip.left_out)
    )
    truth = "a network's" if clip.name == CLIPS[2] else "made by hand"
    return Table(
        f"clip_{clip.name}",
        f"{clip.name}: distance from the marks (pixels), points within a share of the body's "
        f"length, {clip.length:.0f} pixels (%)",
        [
            "",
            "in view",
            "hidden",
            *(f"within {share:g}" for share in SHARES),
            f"found again, of {len(back)} (%)",
        ],
        rows,
        f"{len(clip.names)} points in {int(clip.marked[1:].sum())} marked frames; marks are "
        f"{truth}, those of hidden points guesses.  Intervals are over runs on this one clip."
        f"{left_out}  Occlusions that end, judged at the first mark in view, within "
        f"{SHARES[1]:g} of the length: {listed}.  Not in the paper.",
    )


def _recovered(clip: Marked, distance: np.ndarray) -> Cell:
    # Where points start they are right: a frame of zeros stands for it.
    start = np.zeros((len(distance), 1, distance.shape[-1]))
    whole = np.concatenate([start, distance], axis=1)[:, clip.marked]
    again = measures.recovered(
        whole, clip.visible[clip.marked], SHARES[1] * clip.length, within=_MARKS
    )
    if again.shape[-1] == 0:
        return Cell()
    by_run = 100 * again.mean(axis=-1)
    if len(by_run) > 1 and np.ptp(by_run) > 0:
        return _cell(by_run, 0)
    low, high = wilson(len(by_run) * by_run[0] / 100, len(by_run))(0.95)
    return Cell(
        None, Measured(float(by_run[0]), *((low, high) if len(by_run) > 1 else (np.nan,) * 2))
    )


def _cell(by_run: np.ndarray, digits: int) -> Cell:
    low, high = student_interval(by_run)(0.95)
    return Cell(None, Measured(float(np.mean(by_run)), low, high), digits)
