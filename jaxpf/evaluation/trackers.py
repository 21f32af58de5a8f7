"""Makes the trackers that are compared: built in, user-defined, or boxes of other programs.

A user-defined tracker is a function of the scene, called once per scene and process.  It returns
a tracker (``jaxpf.contract.Tracker``), or boxes ``[T, P, 4]`` of all frames including the start
frame, which count as one deterministic run.  A tracker's estimates are interpreted by the scene's
target (for boxes: u, v, scale) unless the tracker has a method
``boxes(estimate [..., P, D]) -> [..., P, 4]``.
"""

import dataclasses
import hashlib
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

import scenes
from jaxpf.contract.errors import InputError
from jaxpf.evaluation.results import Configuration
from jaxpf.files.reading import read_text
from jaxpf.measures.association import pairwise_iou
from jaxpf.sequences.tables import BoxTable, dense, read_boxes
from jaxpf.targets import building
from jaxpf.targets.target import Looks, Target
from scenes import Scene

#: One frame in this many samples the appearance of a scene.
_EVERY = 8
#: Overlap with the truth at which the MOTChallenge counts a box as a match.
_MATCH = 0.5


def tracker_of(scene: Scene, target: Target, configuration: Configuration) -> Any:
    """Make the tracker of a built-in configuration: a filter on the scene's target."""
    values = configuration.parameters | configuration.variant
    looks = looks_of(scene, values.get("num_particles"))
    return building.build(target, values, target.scene_start(scene), looks)


def looks_of(scene: Scene, num_particles: int | None) -> Looks:
    """Appearance of a scene's objects."""
    return building.looks_of_scene(scene, num_particles, typical=scene.frames[::_EVERY])


@dataclasses.dataclass(frozen=True)
class OwnTracker:
    """A user-defined function of the scene, ``FILE.py:FUNCTION``; pickling carries its text.

    Attributes:
        path: of the file, absolute.
        function: name of the function.
        text: of the file.
    """

    path: str
    function: str
    text: str

    @classmethod
    def read(cls, place: str) -> "OwnTracker":
        """Read the file of ``FILE.py:FUNCTION``."""
        path, colon, function = place.rpartition(":")
        if not colon or not path.endswith(".py") or not function.isidentifier():
            raise InputError(
                f"the tracker {place!r} has another form than FILE.py:FUNCTION; name a function of "
                "a Python file."
            )
        text = read_text(Path(path), "a tracker", "a Python file.")
        if function not in text:
            names = re.findall(r"^def (\w+)", text, re.MULTILINE)
            raise InputError(
                f"'{path}' has no function {function!r}; name one that it has: "
                f"{', '.join(names) or 'it has none'}."
            )
        return cls(str(Path(path).resolve()), function, text)

    @property
    def sha256(self) -> str:
        """Digest of the file's text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def __call__(self, scene: Scene) -> Any:
        """Call the function with a scene."""
        return scenes.function_of_text(self.text, self.path, self.function)(scene)


def own_tracker(name: str, function: Any, scene: Scene) -> Any:
    """Call a user's function on a scene; returns a tracker, boxes ``[T, P, 4]`` or points.

    Raises:
        InputError: the function fails or returns something else.
    """
    try:
        tracker = function(scene)
        boxes = np.asarray(tracker, np.float64) if hasattr(tracker, "__array__") else None
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        cause = scenes.cause_of(error, getattr(function, "path", ""))
        raise InputError(f"the tracker {name!r} cannot be made: {cause}; correct it.") from error
    if hasattr(tracker, "init") and hasattr(tracker, "step"):
        if isinstance(tracker, type) or any(leaf is tracker for leaf in jax.tree.leaves(tracker)):
            raise InputError(
                f"the tracker {name!r} is no pytree; return an object of a class that is decorated "
                "by @jaxpf.pytree_dataclass."
            )
        return tracker
    if boxes is None:
        raise InputError(
            f"the tracker {name!r} is {type(tracker).__name__}; return a tracker with init and "
            "step, or boxes [T, P, 4]."
        )
    points: Any = scene.extras.get("points")
    if boxes.shape not in (scene.boxes.shape, np.shape(points)):
        raise InputError(
            f"the tracker {name!r} returned boxes of shape {list(boxes.shape)}; the scene has "
            f"{list(scene.boxes.shape)}: all frames, the start frame included."
        )
    return boxes


def read_boxes_like(
    path: str | os.PathLike[str], truth: np.ndarray, ids: Sequence[int], start_frame: int = 0
) -> np.ndarray:
    """Read another tracker's boxes and arrange them like the truth of a scene.

    Args:
        path: a MOT file, counting from 1, or a CSV with the header of a ``gt.csv``, counting from
            0; rows without width and height stand for absent objects.
        truth: true boxes ``[T, P, 4]``; row t is frame ``start_frame + t`` of the sequence.
        ids: ground-truth id of each of the P objects.
        start_frame: first frame of the scene in the sequence, counting from 0.

    Returns:
        float64 ``[T, P, 4]``, NaN where the file has no box.  ``match_tracks`` assigns the file's
        ids to objects; an object without a track is NaN throughout.

    Raises:
        InputError: the file cannot be read, has no boxes in these frames, or matches no object.
    """
    table = read_boxes(path)
    matched = match_tracks(table, truth, ids, start_frame)
    followed = [column for column, identity in enumerate(matched) if identity is not None]
    identities = [identity for identity in matched if identity is not None]
    boxes = np.full(truth.shape, np.nan)
    boxes[:, followed] = dense(table, identities, start_frame + len(truth))[start_frame:]
    return boxes


def match_tracks(
    table: BoxTable, truth: np.ndarray, ids: Sequence[int], start_frame: int = 0
) -> list[int | None]:
    """Match the tracks of a file to the objects; arguments as for ``read_boxes_like``.

    Two rules apply in the first frame, from ``start_frame`` on, in which the file has a box:

    1. The file uses the truth's ids if all of ``ids`` occur in it and no box of another id
       overlaps an object more than the object's own box does (or, if the frame lacks the own box,
       by .5 or more).
    2. Otherwise tracks are assigned greedily by IoU (intersection over union), one track per
       object, down to an IoU of .5, the MOTChallenge's threshold for a match.

    Returns:
        The id in the table for each object; None for an object without a matching track.

    Raises:
        InputError: the T frames hold no box, or no box matches an object.
    """
    last_frame = start_frame + len(truth) - 1
    frames = table.frame[(table.frame >= start_frame) & (table.frame <= last_frame)]
    if len(frames) == 0:
        has = f"lie in {table.frame.min()} to {table.frame.max()}" if len(table) else "are none"
        raise InputError(
            f"{table.source} has no box in the scene's frames {start_frame} to {last_frame}: its "
            f"frames (counting from 0) {has}; check that it belongs to the scene"
        )
    frame = int(frames.min())
    rows = np.flatnonzero(table.frame == frame)
    there = table.id[rows]
    iou = pairwise_iou(truth[frame - start_frame], table.box[rows])  # [P, rows]

    is_own = np.asarray(ids)[:, None] == there
    own, best = np.where(is_own, iou, 0).max(axis=1), iou.max(axis=1)
    is_contradicted = (best > own) & (is_own.any(axis=1) | (best >= _MATCH))
    if set(ids) <= set(table.id.tolist()) and not is_contradicted.any():
        return [int(identity) for identity in ids]

    matched: list[int | None] = [None] * len(ids)
    while iou.max() >= _MATCH:
        column, row = np.unravel_index(np.argmax(iou), iou.shape)
        matched[column] = int(there[row])
        iou[column], iou[:, row] = 0, 0
    if all(identity is None for identity in matched):
        raise InputError(
            f"no box of {table.source} in frame {frame} (counting from 0) overlaps an object of "
            f"the scene by {_MATCH:g} or more; check that it belongs to the scene, and that it "
            "counts frames and pixels from 1 if it has no header"
        )
    return matched
