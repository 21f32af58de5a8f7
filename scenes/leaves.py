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

from scenes import drawing
from scenes.drawn import Drawn, Range, streams
from scenes.scene import Scene

_POINTS = 60
#: Start positions x and y in half travels; leaves from above and below travel less, because there
#: is less space.
_SIDES = ((-1.0, 0.0), (1.0, 0.0), (0.0, -0.8), (0.0, 0.8))


@dataclasses.dataclass(frozen=True)
class Leaves(Drawn):
    """The scene and its parameters.

    Attributes:
        leaves: their number, 2 to 4.
        travel: distance that each leaf's centre moves, across the middle to the other side.
        separation: distance between two paths in opposite directions.
        leaf_texture: standard deviation within a leaf.
        noise: standard deviation of every pixel, in every frame.
    """

    name: ClassVar[str] = "leaves"
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

    def draw(self, seed: int) -> Scene:
        """Draw the scene."""
        paths, background, pixels = streams(seed, 3)
        outlines, grounds = self._draw_paths(paths), self._draw_foliage(background)
        shape = self.frame_height, self.frame_width
        greys = self.leaf_grey + self.leaf_texture * drawing.texture(pixels, *shape, 2.0)
        orders = list(permutations(range(self.leaves)))
        order = orders[pixels.integers(len(orders))]

        def paint(picture: np.ndarray, leaf: np.ndarray) -> None:
            drawing.paint_body(picture, leaf, greys, seam=self.leaf_grey - 60)

        frames = drawing.painted(grounds, outlines, order[::-1], paint, self.noise, pixels)
        overlaps = np.array([_overlaps(leaves, shape) for leaves in outlines])
        by_depth = np.repeat([order], self.num_frames, axis=0)
        pairs = combinations(order, 2)
        return drawing.scene_of_outlines(
            self,
            seed,
            frames,
            outlines,
            closed=True,
            order=by_depth,
            front=by_depth[:, 0],
            overlaps=overlaps,
            overlap=np.max([overlaps[:, farther, nearer] for nearer, farther in pairs], axis=0),
        )

    def _draw_paths(self, rng: np.random.Generator) -> np.ndarray:
        count = self.num_frames
        share = np.linspace(-0.5, 0.5, count)
        leaf = leaf_outline(self.leaf_length, self.leaf_width)
        outlines = np.empty((count, self.leaves, _POINTS, 2))
        for target in range(self.leaves):
            side = np.array(_SIDES[target])
            beside = (-1) ** target * self.separation / 2 * (side == 0)
            sway = drawing.wandering(rng, count, 6, self.sway_period) * self.sway
            # A leaf's corners lie about half its length from its centre.
            linear = np.eye(2) + sway[:, 2:].reshape(count, 2, 2) / (self.leaf_length / 2)
            path = -side * share[:, None] * self.travel + beside
            middle = self.size / 2 + path + sway[:, :2]
            outlines[:, target] = middle[:, None] + np.einsum("tij,sj->tsi", linear, leaf)
        return outlines

    def _draw_foliage(self, rng: np.random.Generator) -> np.ndarray:
        """``[T, H, W]``: blobs that sway over a dark ground."""
        count, (width, height) = self.num_frames, self.size
        grounds = np.full((count, height, width), 90.0)
        for _ in range(self.foliage):
            scale = rng.uniform(0.3, 1.0)
            blot = leaf_outline(self.leaf_length * scale, self.leaf_width * scale)
            angle, place = rng.uniform(0, 2 * np.pi), rng.uniform((0, 0), (width, height))
            cosine, sine = np.cos(angle), np.sin(angle)
            blot = blot @ np.array([[cosine, sine], [-sine, cosine]]) + place
            grey = 90 + self.foliage_contrast * rng.standard_normal()
            path = self.foliage_sway * drawing.wandering(rng, count, 2, self.sway_period)
            for ground, shift in zip(grounds, path, strict=True):
                drawing.paint_inside(ground, blot + shift, grey)
        return grounds


def leaf_outline(length: float, width: float) -> np.ndarray:
    """A leaf around the origin, ``[S, 2]``, clockwise, tip upwards."""
    angle = np.linspace(0, 2 * np.pi, _POINTS, endpoint=False)
    across = width / 2 * np.sin(angle) * (1 + 0.25 * np.cos(angle))
    return np.stack([across, -length / 2 * np.cos(angle)], axis=1)


def _overlaps(outlines: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """``[P, P]``: share of outline i's pixels inside outline j."""
    masks = []
    for outline in outlines:
        mask = np.zeros(shape, np.uint8)
        cv2.fillPoly(mask, [np.rint(outline - 0.5).astype(np.int32)], 1)
        masks.append(mask.ravel() > 0)
    both = np.array([[(target & other).sum() for other in masks] for target in masks])
    return both / np.maximum(np.diagonal(both), 1)[:, None]
