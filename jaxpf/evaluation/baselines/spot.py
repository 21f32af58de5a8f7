"""Structure-preserving tracking (SPOT): part templates joined by springs, with exact search.

Source: Zhang and van der Maaten, "Structure preserving object tracking", CVPR 2013, implemented
from its description.  The score of a configuration of parts is

    sum_i w_i . phi(x_i) - stiffness * sum_(i, j) |(x_i - x_j) - e_ij|^2

with phi the HOG features around a part and the edges (i, j) a minimum spanning tree of the parts'
initial positions.  Dynamic programming over the tree, with a distance transform on every edge,
finds the best configuration.  Then w and e take a passive-aggressive step towards it and away from
its best rival.  Choices that the paper leaves open are documented here.
"""

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError

#: Largest displacement of a spring, in cells, in either direction.
_REACH = 12
#: Learning steps in the first frame.
_FIRST_STEPS = 5
#: Unsigned orientations of a HOG cell, and the features of a cell: each of four blocks normalises
#: its histogram.
ORIENTATIONS = 9
FEATURES = 4 * ORIENTATIONS
#: Normalised values of HOG are clipped here (Dalal and Triggs 2005).
_LARGEST = 0.2


class Options(NamedTuple):
    """Options of SPOT.

    Attributes:
        cell: side of a HOG cell in pixels; estimates move in steps of one cell.
        size: cells along a part's side, odd.
        stiffness: of the springs, per squared cell.
        aggressiveness: K; larger values take larger steps, and 0 stops learning after the first
            frame.
        least_score: a part learns only while its score is at least this share of its first score.
    """

    cell: int = 4
    size: int = 5
    stiffness: float = 0.02
    aggressiveness: float = 0.05
    least_score: float = 0.5


def spot(
    frames: Iterable[np.ndarray], points: ArrayLike, options: Options | None = None
) -> np.ndarray:
    """Track points; the result is deterministic.

    Args:
        frames: T + 1 frames, uint8 RGB [H, W, 3].
        points: [P, 2], x and y in pixels in the first frame.
        options: ``Options()`` by default.

    Returns:
        Positions [T, P, 2] in the frames after the first.
    """
    options = options or Options()
    points = np.asarray(points, float)
    places = []
    model = None
    for frame in frames:
        features = _padded(hog(frame, options.cell), options.size)
        if model is None:
            height, width = frame.shape[:2]
            if np.any((points < 0) | (points >= [width, height])):
                raise InputError(
                    f"a point lies outside the frame of {width} x {height} pixels: move it inside."
                )
            model = _Model(features, points, options)
            continue
        places.append(model.step(features))
    return np.array(places).reshape(-1, len(points), 2)


class _Model:
    """Templates, springs, and each point's offset from the middle of its cell."""

    def __init__(self, features: np.ndarray, points: np.ndarray, options: Options):
        self.options = options
        limit = np.array(_shape(features, options.size))[::-1] - 1
        cells = np.minimum(np.floor(points / options.cell).astype(int), limit)
        self.rest = points - options.cell * (cells + 0.5)
        self.parents, self.order = _tree(points)
        self.springs = (cells - cells[self.parents]).astype(float)
        self.templates = _patches(features, cells, options.size)
        self.templates -= self.templates.mean(axis=(1, 2, 3), keepdims=True)
        norms = (self.templates**2).sum(axis=(1, 2, 3), keepdims=True)
        self.templates /= np.maximum(norms, 1e-6)
        # The first positions are known, so learn from them with full aggressiveness.
        for _ in range(_FIRST_STEPS):
            scores = _responses(features, self.templates)
            self._learn(features, scores, cells, np.ones(len(cells), bool), aggressiveness=1.0)
        scores = _responses(features, self.templates)
        self.first = scores[np.arange(len(cells)), cells[:, 1], cells[:, 0]]

    def step(self, features: np.ndarray) -> np.ndarray:
        """Locate the parts in a frame and learn from it; returns positions [P, 2] in pixels."""
        responses = _responses(features, self.templates)
        cells = self._best(responses)
        scores = responses[np.arange(len(cells)), cells[:, 1], cells[:, 0]]
        sure = scores >= self.options.least_score * self.first
        if self.options.aggressiveness > 0:
            self._learn(features, responses, cells, sure, self.options.aggressiveness)
        return self.options.cell * (cells + 0.5) + self.rest

    def _best(self, responses: np.ndarray) -> np.ndarray:
        """Find the best configuration [P, 2] (column, row) by dynamic programming."""
        score = responses.copy()
        choices: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        whole = np.round(self.springs).astype(int)
        for part in reversed(self.order[1:]):
            message, across, down = _transformed(score[part], self.options.stiffness)
            choices[part] = across, down
            score[self.parents[part]] += _shifted(message, whole[part])
        cells = np.zeros((len(score), 2), int)
        root = self.order[0]
        cells[root] = np.unravel_index(np.argmax(score[root]), score[root].shape)[::-1]
        limit = np.array(score.shape[:0:-1]) - 1
        for part in self.order[1:]:
            column, row = np.clip(cells[self.parents[part]] + whole[part], 0, limit)
            across, down = choices[part]
            row_chosen = row + down[row, column]
            cells[part] = column + across[row_chosen, column], row_chosen
        return cells

    def _learn(self, features, responses, cells, sure, aggressiveness) -> None:
        """Take a passive-aggressive step away from the best rival configuration."""
        margin = _loss(responses.shape[1:], cells, self.options.size)
        rival = self._best(responses + margin)
        every = np.arange(len(cells))

        def total(at, maps):
            apart = at - at[self.parents] - self.springs
            tension = self.options.stiffness * (apart**2).sum()
            return maps[every, at[:, 1], at[:, 0]].sum() - tension

        loss = total(rival, responses + margin) - total(cells, responses)
        if loss <= 0:
            return
        size, stiffness = self.options.size, self.options.stiffness
        towards = _patches(features, cells, size) - _patches(features, rival, size)
        towards = towards * sure[:, None, None, None]
        relative = cells - cells[self.parents], rival - rival[self.parents]
        stretch = 2 * stiffness * (relative[0] - relative[1]) * sure[:, None]
        length = (towards**2).sum() + (stretch**2).sum()
        rate = loss / (length + 1 / (2 * aggressiveness))
        self.templates = self.templates + rate * towards
        self.springs = self.springs + rate * stretch


def _tree(points: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """A minimum spanning tree: parent of each part (the root is its own), and parents first."""
    root = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    parents, order = np.full(len(points), root), [root]
    near = np.linalg.norm(points - points[root], axis=1)
    near[root] = np.inf
    while len(order) < len(points):
        part = int(np.argmin(near))
        order.append(part)
        near[part] = np.inf
        away = np.linalg.norm(points - points[part], axis=1)
        closer = (away < near) & np.isfinite(near)
        parents[closer], near[closer] = part, away[closer]
    return parents, order


def _padded(features: np.ndarray, size: int) -> np.ndarray:
    return np.pad(features, ((size // 2, size // 2), (size // 2, size // 2), (0, 0)))


def _shape(features: np.ndarray, size: int) -> tuple[int, int]:
    return features.shape[0] - size + 1, features.shape[1] - size + 1


def _patches(features: np.ndarray, cells: np.ndarray, size: int) -> np.ndarray:
    """Features ``[P, size, size, F]`` around each of the cells [P, 2] (column, row)."""
    steps = np.arange(size)
    rows, columns = cells[:, 1, None] + steps, cells[:, 0, None] + steps
    return features[rows[:, :, None], columns[:, None, :]].astype(float)


def _responses(features: np.ndarray, templates: np.ndarray) -> np.ndarray:
    """Correlation of each template with the features around each cell: [P, rows, columns]."""
    parts, size = templates.shape[:2]
    rows, columns = _shape(features, size)
    # One product of all cells of all templates with the frame, then the sum over a template.
    weights = np.moveaxis(templates, 0, 2).reshape(-1, features.shape[-1]).astype(np.float32)
    products = weights @ features.reshape(-1, features.shape[-1]).T
    products = products.reshape(size, size, parts, *features.shape[:2])
    total = np.zeros((parts, rows, columns), np.float32)
    for i in range(size):
        for j in range(size):
            total += products[i, j, :, i : i + rows, j : j + columns]
    return total


def _transformed(score: np.ndarray, stiffness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance transform: for each cell p, the maximum over q of score(q) - stiffness |p - q|^2.

    Returns the maximum and the offsets of q: across (from the transform of rows) and down.
    """
    across_best, across = _along(score, stiffness, axis=1)
    best, down = _along(across_best, stiffness, axis=0)
    return best, across, down


def _along(score: np.ndarray, stiffness: float, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance transform along one axis, and the offset of the maximum."""
    score = np.ascontiguousarray(np.moveaxis(score, axis, 0))
    best, choice = score.copy(), np.zeros(score.shape, np.int16)
    span = score.max() - score.min()
    for step in range(1, min(_REACH, len(score) - 1) + 1):
        if stiffness * step**2 > span:  # no cell so far away is better
            break
        for sign in (-1, 1):
            here = slice(step, None) if sign < 0 else slice(None, -step)
            there = slice(None, -step) if sign < 0 else slice(step, None)
            value = score[there] - np.float32(stiffness * step**2)
            better = value > best[here]
            np.copyto(best[here], value, where=better)
            np.copyto(choice[here], sign * step, where=better)
    return np.moveaxis(best, 0, axis), np.moveaxis(choice, 0, axis)


def _shifted(values: np.ndarray, by: np.ndarray) -> np.ndarray:
    """``values`` at each cell plus ``by`` (columns, rows), clamped to the edge."""
    rows, columns = values.shape
    row = np.clip(np.arange(rows) + by[1], 0, rows - 1)
    column = np.clip(np.arange(columns) + by[0], 0, columns - 1)
    return values[row[:, None], column]


def _loss(shape: tuple[int, ...], cells: np.ndarray, size: int) -> np.ndarray:
    """1 minus the IoU of a part at each cell with the part at its own: [P, rows, columns]."""
    across = np.maximum(size - np.abs(np.arange(shape[1]) - cells[:, :1]), 0)
    down = np.maximum(size - np.abs(np.arange(shape[0]) - cells[:, 1:]), 0)
    shared = down[:, :, None] * across[:, None, :]
    return (1 - shared / (2 * size**2 - shared)).astype(np.float32)


def hog(frame: np.ndarray, cell: int) -> np.ndarray:
    """Histograms of oriented gradients of a uint8 RGB frame [H, W, 3] (Dalal and Triggs 2005).

    Returns float32 [H // cell, W // cell, FEATURES].  Each cell is normalised by the four blocks of
    two by two cells that contain it.
    Cell (i, j) is the square of pixels [j * cell, (j + 1) * cell) x [i * cell, (i + 1) * cell).
    """
    rows, columns = frame.shape[0] // cell, frame.shape[1] // cell
    picture = np.ascontiguousarray(frame[: rows * cell, : columns * cell]).astype(np.float32) / 255
    across: np.ndarray = cv2.filter2D(picture, -1, np.array([[-1.0, 0.0, 1.0]]))
    down: np.ndarray = cv2.filter2D(picture, -1, np.array([[-1.0], [0.0], [1.0]]))
    strength = across**2 + down**2
    channel = np.argmax(strength, axis=-1)[..., None]  # the channel with the steepest gradient
    across, down, strength = (
        np.take_along_axis(values, channel, axis=-1)[..., 0] for values in (across, down, strength)
    )
    strength = np.sqrt(strength)
    place = np.mod(np.arctan2(down, across) / np.pi, 1.0) * ORIENTATIONS
    lower = np.floor(place - 0.5)
    share = place - 0.5 - lower
    histogram = np.empty((rows, columns, ORIENTATIONS), np.float32)
    first = np.mod(lower, ORIENTATIONS).astype(np.uint8)
    second = np.mod(lower + 1, ORIENTATIONS).astype(np.uint8)
    for bin_number in range(ORIENTATIONS):
        votes = strength * ((first == bin_number) * (1 - share) + (second == bin_number) * share)
        # INTER_AREA gives the mean over each cell; cells are whole pixels, so none is split.
        histogram[..., bin_number] = cv2.resize(
            votes.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA
        )
    energy = np.pad((histogram**2).sum(axis=-1), 1, mode="edge")
    blocks = energy[:-1, :-1] + energy[1:, :-1] + energy[:-1, 1:] + energy[1:, 1:]
    normalised = [
        np.minimum(
            histogram / np.sqrt(blocks[i : i + rows, j : j + columns, None] + 1e-4), _LARGEST
        )
        for i in (0, 1)
        for j in (0, 1)
    ]
    return np.concatenate(normalised, axis=-1)
