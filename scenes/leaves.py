"""Leaves that pass each other before moving foliage, some in front of others.

After the leaf sequence of maccormick1999, figure 7, which was never published: two similar leaves
that move affinely, in moving clutter, with occlusion.  All numbers are our choices.  An optional
third leaf comes from above and a fourth from below; all pass the middle at the same time.

``extras``, of P leaves: ``outlines`` ``[T, P, S, 2]``; ``closed``, true; ``order`` ``[T, P]``, the
targets by depth, nearest to the camera first, and ``front`` ``[T]``, the nearest; ``overlaps``
``[T, P, P]``, the share of target i's area inside target j's outline, at ``[t, i, j]``, and
``overlap`` ``[T]``, the largest share of a leaf that a single nearer leaf occludes.
"""

import dataclasses
from itertools import combinations, permutations
from typing import Annotated, ClassVar

import cv2
import numpy as np

from scenes import drawing as drawn
from scenes.parameters import Parameters, Range
from scenes.scene import Scene

_PATHS, _BACKGROUND, _PIXELS = range(3)
_POINTS = 60
#: Start positions x and y in half travels; leaves from above and below travel less, because there
#: is less space.
_SIDES = ((-1.0, 0.0), (1.0, 0.0), (0.0, -0.8), (0.0, 0.8))


@dataclasses.dataclass(frozen=True)
class LeavesParameters(Parameters):
    """Parameters of the leaves scene.

    Attributes:
        leaves: their number, 2 to 4.
        travel: distance that each leaf's centre moves, across the middle to the other side.
        separation: distance between two paths in opposite directions.
        leaf_texture: standard deviation within a leaf.
        noise: standard deviation of every pixel, in every frame.
    """

    scene: ClassVar[str] = "leaves"
    leaves: Annotated[int, Range(2, len(_SIDES))] = 2
    travel: float = 130.0
    separation: float = 14.0
    leaf_texture: float = 6.0
    noise: float = 4.0

    leaf_length: ClassVar[float] = 90.0  # from stem to tip
    leaf_width: ClassVar[float] = 50.0
    sway: ClassVar[float] = 4.0  # standard deviation, pixels at the corners
    sway_period: ClassVar[float] = 30.0
    leaf_grey: ClassVar[float] = 190.0
    foliage: ClassVar[int] = 60  # blobs in the background
    foliage_contrast: ClassVar[float] = 25.0  # standard deviation
    foliage_sway: ClassVar[float] = 4.0  # standard deviation


def leaves_scene(parameters: LeavesParameters, seed: int) -> Scene:
    """Generate the scene."""
    outlines = _draw_paths(parameters, np.random.default_rng([seed, _PATHS]))
    grounds = _draw_foliage(parameters, np.random.default_rng([seed, _BACKGROUND]))
    height, width = parameters.frame_height, parameters.frame_width
    rng = np.random.default_rng([seed, _PIXELS])
    veins = parameters.leaf_texture * drawn.texture(rng, height, width, 2.0)
    orders = list(permutations(range(parameters.leaves)))
    order = orders[rng.integers(len(orders))]
    frames = np.empty((parameters.num_frames, height, width, 3), np.uint8)
    overlaps = np.empty((parameters.num_frames, parameters.leaves, parameters.leaves))
    for t, (frame, leaves) in enumerate(zip(frames, outlines, strict=True)):
        picture = grounds[t]
        for target in reversed(order):
            grey = parameters.leaf_grey
            drawn.paint_body(picture, leaves[target], grey + veins, seam=grey - 60)
        frame[...] = drawn.noisy(picture, parameters.noise, rng)
        overlaps[t] = _overlaps(leaves, (height, width))
    by_depth = np.repeat([order], parameters.num_frames, axis=0)
    pairs = combinations(order, 2)
    return drawn.make_scene(
        frames,
        outlines,
        parameters,
        seed,
        closed=True,
        order=by_depth,
        front=by_depth[:, 0],
        overlaps=overlaps,
        overlap=np.max([overlaps[:, farther, nearer] for nearer, farther in pairs], axis=0),
    )


def leaf_outline(length: float, width: float) -> np.ndarray:
    """A leaf around the origin, ``[S, 2]``, clockwise, tip upwards."""
    angle = np.linspace(0, 2 * np.pi, _POINTS, endpoint=False)
    across = width / 2 * np.sin(angle) * (1 + 0.25 * np.cos(angle))
    return np.stack([across, -length / 2 * np.cos(angle)], axis=1)


def _draw_paths(parameters: LeavesParameters, rng: np.random.Generator) -> np.ndarray:
    count = parameters.num_frames
    share = np.linspace(-0.5, 0.5, count)
    leaf = leaf_outline(parameters.leaf_length, parameters.leaf_width)
    outlines = np.empty((count, parameters.leaves, _POINTS, 2))
    for target in range(parameters.leaves):
        side = np.array(_SIDES[target])
        beside = (-1) ** target * parameters.separation / 2 * (side == 0)
        sway = drawn.wandering(rng, count, 6, parameters.sway_period) * parameters.sway
        # A leaf's corners lie about half its length from its centre.
        linear = np.eye(2) + sway[:, 2:].reshape(count, 2, 2) / (parameters.leaf_length / 2)
        path = -side * share[:, None] * parameters.travel + beside
        size = np.array([parameters.frame_width, parameters.frame_height])
        middle = size / 2 + path + sway[:, :2]
        outlines[:, target] = middle[:, None] + np.einsum("tij,sj->tsi", linear, leaf)
    return outlines


def _draw_foliage(parameters: LeavesParameters, rng: np.random.Generator) -> np.ndarray:
    """``[T, H, W]``: blobs that sway over a dark ground."""
    count, size = parameters.num_frames, (parameters.frame_width, parameters.frame_height)
    grounds = np.full((count, size[1], size[0]), 90.0)
    for _ in range(parameters.foliage):
        scale = rng.uniform(0.3, 1.0)
        blot = leaf_outline(parameters.leaf_length * scale, parameters.leaf_width * scale)
        angle, place = rng.uniform(0, 2 * np.pi), rng.uniform((0, 0), size)
        cosine, sine = np.cos(angle), np.sin(angle)
        blot = blot @ np.array([[cosine, sine], [-sine, cosine]]) + place
        grey = 90 + parameters.foliage_contrast * rng.standard_normal()
        path = parameters.foliage_sway * drawn.wandering(rng, count, 2, parameters.sway_period)
        for ground, shift in zip(grounds, path, strict=True):
            drawn.paint_inside(ground, blot + shift, grey)
    return grounds


def _overlaps(outlines: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """``[P, P]``: share of outline i's pixels inside outline j."""
    masks = []
    for outline in outlines:
        mask = np.zeros(shape, np.uint8)
        cv2.fillPoly(mask, [np.rint(outline - 0.5).astype(np.int32)], 1)
        masks.append(mask.ravel() > 0)
    both = np.array([[(target & other).sum() for other in masks] for target in masks])
    return both / np.maximum(np.diagonal(both), 1)[:, None]
