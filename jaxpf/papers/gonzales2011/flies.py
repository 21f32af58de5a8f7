"""A real articulated object: a fly and its legs, from the clip ``sleap_fly_pair``.

The paper leaves real sequences to later work.  Pictures are grey and legs a few pixels wide, so
colour histograms say little: parts are compared pixel by pixel (``jaxpf.likelihoods.patch``).
"""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.likelihoods.patch import PatchLikelihood, patch
from jaxpf.ordering import named
from jaxpf.papers.gonzales2011.scenes import METHODS, SWAPS
from jaxpf.papers.paper import clip_folder, reading_clips
from jaxpf.parts.models import parts_model
from jaxpf.running.blocks import monte_carlo
from jaxpf.shapes import rectangles
from scenes import read_clip
from scenes.keypoints import Keypoints, read_keypoints

CLIP = "sleap_fly_pair"
#: The fly of which all joints are marked in frame 0.
FLY = 0
FRAMES, PARTICLES, RUNS = 300, 100, 20


class Segment(NamedTuple):
    """A part of the fly: a rectangle from one joint to another.

    Attributes:
        parent: index of the part it hangs on, -1 for the root.
        start: joint at which it hangs.
        end: joint at its other end.
        width: pixels, with some of the background on either side of a leg.
    """

    parent: int
    start: str
    end: str
    width: float


def _segments() -> tuple[Segment, ...]:
    trunk = [
        Segment(-1, "neck", "thorax", 14),
        Segment(0, "neck", "head", 14),
        Segment(0, "thorax", "abdomen", 14),
        Segment(0, "thorax", "wingL", 10),
        Segment(0, "thorax", "wingR", 10),
    ]
    legs = [f"{leg}leg{side}" for leg in ("fore", "mid", "hind") for side in "LR"]
    upper = [Segment(0, f"{leg}1", f"{leg}2", 8) for leg in legs]
    lower = [
        Segment(len(trunk) + number, f"{leg}2", f"{leg}3", 8) for number, leg in enumerate(legs)
    ]
    return (*trunk, *upper, *lower)


SEGMENTS = _segments()
PARENTS = tuple(segment.parent for segment in SEGMENTS)
#: A part is at least this long, pixels: some joints are marked nearly on top of one another.
_SHORTEST = 8.0

#: Chosen on frames 300 to 450 of the same fly; results are reported on the first 300.
SIGMA = 0.35
SCALE = (1.5, 1.5, 0.05)
JOINT_SCALE = (0.5, 0.5, 0.12)
_WINDOW = (10, 8)
#: Runs that are vectorised together; the devices share the batches.
TOGETHER = 10


class Fly(NamedTuple):
    """The clip's frames and the joints of one fly.

    Attributes:
        frames: ``[T, H, W, 3]`` uint8.
        joints: ``[T, P + 1, 2]``: where the root begins, then where every part ends; pixels, NaN
            where a joint is not marked.
        starts: ``[T, P, 2]``: where every part begins.
    """

    frames: np.ndarray
    joints: np.ndarray
    starts: np.ndarray


def read_fly(data: Path, first: int = 0, num_frames: int = FRAMES) -> Fly:
    """Frames ``first`` to ``first + num_frames`` of the clip in the folder of real clips.

    Raises:
        InputError: the clip is missing or cannot be read, or a joint is not marked in ``first``.
    """
    folder = clip_folder(data, CLIP)
    with reading_clips():
        clip = read_clip(folder)
        keypoints = read_keypoints(folder)
        frames = np.stack(list(itertools.islice(clip.frames(), first, first + num_frames + 1)))
    fly = _of_fly(keypoints, frames, first)
    if not np.isfinite(fly.joints[0]).all():
        raise InputError(
            f"not every joint of fly {FLY} is marked in frame {first}; choose another."
        )
    return fly


def _of_fly(keypoints: Keypoints, frames: np.ndarray, first: int) -> Fly:
    def places(*names: str) -> np.ndarray:
        # A pixel's middle lies half a pixel from its number.
        return keypoints.of(FLY, *names)[first : first + len(frames)] + 0.5

    return Fly(
        frames=frames,
        joints=places(SEGMENTS[0].start, *(segment.end for segment in SEGMENTS)),
        starts=places(*(segment.start for segment in SEGMENTS)),
    )


def start_of(fly: Fly) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Poses ``[P, 3]``, sizes ``[P, 2]`` and anchors of the parts in the first frame."""
    start, end = fly.starts[0], fly.joints[0, 1:]
    along = end - start
    theta = np.arctan2(along[:, 1], along[:, 0])
    length = np.maximum(np.linalg.norm(along, axis=1), _SHORTEST)
    lever = np.stack([length / 2, np.zeros_like(length)])
    centre = start + np.stack(rectangles.turned(lever, theta), axis=-1)
    poses = np.column_stack([centre, theta])
    parents = np.array(PARENTS)
    apart = (start - centre[parents]).T
    parent_anchor = np.stack(rectangles.turned(apart, -theta[parents]), axis=-1)
    parent_anchor[parents < 0] = 0
    sizes = np.column_stack([length, [segment.width for segment in SEGMENTS]])
    return poses, sizes, (parent_anchor, -lever.T)


def joints_at(poses: Any, sizes: np.ndarray) -> np.ndarray:
    """The joints ``[..., P + 1, 2]`` of parts at ``poses [..., P, 3]``; see ``Fly.joints``."""
    corners = np.asarray(rectangles.corners_from_poses(poses, sizes))
    starts, ends = corners[..., [0, 3], :].mean(axis=-2), corners[..., [1, 2], :].mean(axis=-2)
    return np.concatenate([starts[..., :1, :], ends], axis=-2)


def trackers(
    fly: Fly, num_particles: int = PARTICLES, sigma: float = SIGMA
) -> Mapping[str, Partitioned]:
    """Method -> tracker; all of them share one compiled kernel."""
    poses, sizes, anchors = start_of(fly)
    likelihood: PatchLikelihood = patch(fly.frames[0], poses, sizes, sigma=sigma, window=_WINDOW)
    model = parts_model(
        likelihood, poses, sizes, PARENTS, scale=SCALE, joint_scale=JOINT_SCALE, anchors=anchors
    )
    return {
        method: Partitioned(
            **model._asdict(),
            ordering=named("ps", PARENTS)
            if method == "PS"
            else named("sps", PARENTS, swap=SWAPS[method]),
            num_particles=num_particles,
        )
        for method in METHODS
    }


def measure(fly: Fly, runs: int = RUNS, num_particles: int = PARTICLES) -> dict[str, np.ndarray]:
    """Distances of the joints from those marked, ``[R, T, P + 1]`` in pixels, for every method.

    "Not moving" leaves the parts where they began: ``[1, T, P + 1]``.
    """
    keys = jnp.stack([jax.random.key(seed) for seed in range(runs)])
    poses, sizes, _ = start_of(fly)
    truth = fly.joints[1:]

    def distance(poses: Any) -> np.ndarray:
        return np.linalg.norm(joints_at(poses, sizes) - truth, axis=-1)

    found = {"not moving": distance(np.broadcast_to(poses, (1, len(truth), *poses.shape)))}
    for method, tracker in trackers(fly, num_particles).items():
        estimate = monte_carlo(
            tracker, keys, jnp.asarray(fly.frames[1:]), _keep_poses, batch_size=TOGETHER
        )
        found[method] = distance(estimate)
    return found


def _keep_poses(state: Any, summary: Any) -> Any:
    return summary.estimate[:, :3]
