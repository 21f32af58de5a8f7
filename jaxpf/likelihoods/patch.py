"""Patch likelihood: compare a window of pixels with a picture, invariant to brightness.

Source: eskil2014, eq. 6 and 7.  With o the window's pixels, r the reference's and E the mean over
the window, all channels together::

    d = r / E[r] - o / E[o],    log p(y | x) = -||d||^2 / sigma^2

On a window of n entries, independent errors add up to a sum that is far too sharp for particles
(21 x 21 pixels RGB, off by 5%: -331).  So here ``||d||^2`` is divided by n; the literal rule is
``norm="sum"``, or sigma divided by the square root of n.  Pixel (i, j), row i and column j, is the
square [j, j + 1) x [i, i + 1); pixels outside the frame are black.

Windows of boxes turn and grow, and are sampled on a grid.  Those of points do neither: they are
blocks of whole pixels, and the rest of the frame needs no processing.

``log_odds_all`` says whether points are where they are reported.  With d the mean squared
difference between a point's window and its reference, e the 5% quantile of d at other places of
the start frame, and s the median strain to the three points that were nearest at the start (the
difference of two points' displacements over their distance at the start, at least a window)::

    log odds = -1.4 - 1.2 log(d / e) - 1.0 log(s + .05)

or, for a single point, ``-1.1 - 1.4 log(d / e)``: a logistic regression on two clips, see "Lost" in
docs/development/defaults.md.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf.contract import Likelihood
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.likelihoods._checks import check_window, points_in, shown_as, sizes_in
from jaxpf.likelihoods._sampled import Turned, window_colours, words_of
from jaxpf.likelihoods.color import check_frame

#: How the squared differences of a window are combined.
NORMS = ("mean", "sum")

#: Of the log odds: constant, and factors of log(d / e) and log(s + .05).
_ODDS = -1.4, -1.2, -1.0
#: The same for a single point.
_ODDS_ALONE = -1.1, -1.4
#: Number of neighbours whose strain is measured, and strain that counts as none.
_NEIGHBOURS, _STIFF = 3, 0.05
#: Lower bound of the mean, of 255, by which a window is divided: noise on black must not look like
#: contrast.
_DARKEST_MEAN = 1.0
#: Share of the other places that match better than e; smallest d; most places per side of the grid.
_BEST, _CLOSEST, _PLACES = 0.05, 1e-4, 48


@pytree_dataclass
class PatchLikelihood(Likelihood):
    """Patch likelihood of P objects; make one with :func:`patch` or :func:`windows`.

    A substate is (u, v, a) or (u, v, a, theta, ...): the window's centre in pixels from the left
    and the top of the frame, its scale, and its rotation in radians, clockwise in the image; the
    window is ``a * w`` by ``a * h``.  That of a point is (u, v, ...); its window is centred on the
    pixel that contains the point.

    Attributes:
        sigma: scalar, sigma_o of eskil2014.
        references: r / E[r], ``[P, rows * columns, 3]``, or of points ``[P, rows, columns * 3]``.
        sizes: ``[P, 2]``, width and height of the window at scale 1, pixels; None for points.
        window: (columns, rows) of the sampling grid, or of a point's window, odd numbers.
        norm: ``"mean"`` (squares are averaged over the window's entries) or ``"sum"``, the
            literal rule, whose exponent is 1323 times as large for 21 x 21 pixels.
        slip: standard deviation in pixels of a point around the window that matches best, because
            surfaces turn and skin slides; the ``model_error`` of x and y.
        elsewhere: ``[P]``, e of the log odds; None if the surroundings are unknown, and then there
            are no log odds.
        places: ``[P, 2]``, the points at the start.
        neighbours: int ``[P, K]``, the nearest other points at the start; None for a single point.
        lengths: ``[P, K]``, their distances at the start, at least a window; None likewise.
    """

    sigma: ArrayLike
    references: jax.Array
    sizes: jax.Array | None = None
    window: tuple[int, int] = static_field(default=(21, 21))
    norm: str = static_field(default="mean")
    slip: ArrayLike = 0.0
    elsewhere: jax.Array | None = None
    places: Any = None
    neighbours: Any = None
    lengths: jax.Array | None = None

    #: Whole pixels are read, so the value changes in steps.
    state_gradient = False
    #: ``observe`` does not depend on parameters that tuning may change.
    fixed_observation = True

    @property
    def model_error(self):
        """Standard deviations of the truth around the best match: the slip in x and y."""
        return self.slip, self.slip, 0.0

    def observe(self, frame):
        """The frame's colours, one word per pixel, uint32 [H + 2, W + 2]; of points the frame.

        Args:
            frame: uint8 RGB [H, W, 3], of points at least as large as the window.
        """
        check_frame(frame)
        if self.sizes is not None:
            return words_of(frame)
        _check_fits(frame, self.window)
        return jnp.asarray(frame)

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods of N particles.

        Args:
            observation: what :meth:`observe` returned.
            partition: int [N], the object each particle's substate belongs to.
            substates: float [D, N].

        Returns:
            [N] in the dtype of ``substates``: NaN where a substate, or u or v of a point, is not
            finite; -inf for a window under one pixel wide or high.
        """
        squares, valid, finite = self._squares(observation, partition, substates)
        total = jnp.mean if self.norm == "mean" else jnp.sum
        log_prob = -total(squares, axis=(1, 2)) / jnp.asarray(self.sigma, squares.dtype) ** 2
        return jnp.where(finite, jnp.where(valid, log_prob, -jnp.inf), jnp.nan)

    @property
    def log_odds_all(self):
        """Function of (observation, partition [P], estimates [D, P]) that returns log odds [P].

        Estimates of some of the points only are judged without their neighbours.

        Raises:
            AttributeError: the likelihood was learned from pictures, without their surroundings.
        """
        if self.elsewhere is None:
            raise AttributeError("no surroundings are known, so there are no log odds")
        return self._log_odds_all

    def _log_odds_all(self, observation, partition, substates):
        squares, _, finite = self._squares(observation, partition, substates)
        distance = jnp.maximum(jnp.mean(squares, axis=(1, 2)), _CLOSEST)
        match = jnp.log(distance) - jnp.log(jnp.asarray(self.elsewhere, distance.dtype))[partition]
        if self.neighbours is None or len(partition) != len(self.places):
            constant, of_match = _ODDS_ALONE
            log_odds = constant + of_match * match
        else:
            constant, of_match, of_strain = _ODDS
            strain = self._strain(partition, substates[:2].T)
            log_odds = constant + of_match * match + of_strain * jnp.log(strain + _STIFF)
        return jnp.where(finite, log_odds, jnp.nan)

    def _strain(self, partition, points):
        """Median strain [P] between each point and its neighbours; points [P, 2]."""
        moved = jnp.zeros_like(points).at[partition].set(points)
        moved -= jnp.asarray(self.places, points.dtype)
        apart = moved[:, None] - moved[jnp.asarray(self.neighbours)]
        strain = jnp.sqrt(jnp.sum(apart**2, axis=-1)) / jnp.asarray(self.lengths, points.dtype)
        ordered, count = jnp.sort(strain, axis=1), strain.shape[1]  # jnp.median is slower
        return (ordered[:, (count - 1) // 2] + ordered[:, count // 2])[partition] / 2

    def _squares(self, observation, partition, substates):
        """Squared differences [N, ...] by entry, and whether windows are valid, and finite."""
        dtype = substates.dtype
        if self.sizes is None:
            finite = jnp.all(jnp.isfinite(substates[:2]), axis=0)
            # Far outside all is black anyway; clip so that the cast to int32 cannot overflow.
            u, v = jnp.where(finite, jnp.clip(substates[:2], -1e6, 1e6), 0.0)
            seen, valid = _blocks(observation, u, v, self.window).astype(dtype), True
        else:
            finite = jnp.all(jnp.isfinite(substates), axis=0)
            (u, v, scale), angles = substates[:3], substates[3:4]
            theta = angles[0] if len(angles) else jnp.zeros_like(u)
            width, height = (jnp.asarray(self.sizes, dtype)[partition] * scale[:, None]).T
            seen = window_colours(observation, Turned(u, v, width, height, theta), self.window)
            valid = (width >= 1) & (height >= 1)
        difference = jnp.asarray(self.references, dtype)[partition] - _normalised(seen)
        return difference**2, valid, finite


def patch(
    frame,
    poses,
    sizes,
    *,
    sigma: float = 0.1,
    window: tuple[int, int] = (21, 21),
    names: Sequence[str] | None = None,
) -> PatchLikelihood:
    """Learn the likelihood of P objects from their windows in one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        poses: [P, 3], x and y of the windows' centres in pixels, and theta in radians, clockwise
            in the image.
        sizes: [P, 2], width and height of the windows, pixels.
        sigma: smaller is sharper; eskil2014 has .1 with its literal rule.
        window: columns and rows of the sampling grid (eskil2014: 21 x 21).
        names: of the windows in messages; by default their numbers.
    """
    sizes = sizes_in(sizes, shown_as("sizes", len(poses), names))
    if names is None:
        names = [f"the window of object {i}" for i in range(len(poses))]
    return _of_boxes(_seen(frame, poses, sizes, window, names), sizes, sigma, window)


def patch_from_pictures(
    pictures: Sequence[np.ndarray],
    sizes=None,
    *,
    sigma: float = 0.1,
    window: tuple[int, int] = (21, 21),
) -> PatchLikelihood:
    """Learn the likelihood of P objects from one upright picture of each.

    Args:
        pictures: P pictures, uint8 RGB [h, w, 3], of any sizes.
        sizes: [P, 2], width and height of the windows at scale 1, pixels; by default the sizes
            of the pictures.
        sigma, window: as in :func:`patch`.
    """
    extents = [(len(picture[0]), len(picture)) for picture in pictures]
    wanted = np.array(extents if sizes is None else sizes)
    sizes = sizes_in(wanted, shown_as("sizes", len(pictures)))
    seen = [
        _seen(
            picture, [(width / 2, height / 2, 0.0)], [(width, height)], window, [f"pictures[{i}]"]
        )
        for i, (picture, (width, height)) in enumerate(zip(pictures, extents, strict=True))
    ]
    return _of_boxes(jnp.concatenate(seen), sizes, sigma, window)


def windows(
    frame,
    points,
    *,
    sigma: float = 0.1,
    window: tuple[int, int] = (21, 21),
    norm: str = "mean",
    slip: float = 0.0,
) -> PatchLikelihood:
    """Learn the likelihood of P points from their windows in one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        points: [P, 2], x and y in pixels, inside the frame.
        sigma: smaller is sharper; .1 in eskil2014, with ``norm="sum"``.
        window: columns and rows, odd numbers (eskil2014: 21 x 21).
        norm: ``"mean"`` or ``"sum"``, see :class:`PatchLikelihood`.
        slip: standard deviation in pixels of a point around the window that matches best.
    """
    check_frame(frame)
    check_known("norm=", norm, NORMS)
    check_number("slip", slip, least=0)
    check_window("window", window)
    if not all(n % 2 for n in window):
        raise InputError(f"window is {window!r}: give two odd numbers of pixels, such as (21, 21).")
    _check_fits(frame, window)
    points, size = points_in(points, frame.shape[:2]), (int(window[0]), int(window[1]))
    u, v = jnp.asarray(points).T
    seen = np.asarray(_blocks(jnp.asarray(frame), u, v, size), np.float32)
    _check_not_black(seen, [f"the window of point {i}" for i in range(len(points))])
    learned = PatchLikelihood(
        sigma=_checked(sigma),
        references=as_array(seen / seen.mean(axis=(1, 2), keepdims=True), float),
        window=size,
        norm=norm,
        slip=as_array(slip, float),
    )
    elsewhere = _matches_elsewhere(np.asarray(frame), points, np.asarray(learned.references), size)
    if elsewhere is None:
        return learned
    neighbours, lengths = _neighbours(points, size)
    return dataclasses.replace(
        learned,
        elsewhere=as_array(elsewhere, float),
        places=as_array(points, float),
        neighbours=neighbours,
        lengths=lengths,
    )


def windows_from_pictures(
    pictures: Sequence[np.ndarray], *, sigma: float = 0.1, norm: str = "mean", slip: float = 0.0
) -> PatchLikelihood:
    """Learn the likelihood of P points from pictures of their surroundings.

    Args:
        pictures: P pictures of one size, uint8 RGB [rows, columns, 3], rows and columns odd.
        sigma, norm, slip: as in :func:`windows`.
    """
    rows, columns = pictures[0].shape[:2]
    middle = [[columns // 2 + 0.5, rows // 2 + 0.5]]
    alone = [
        windows(picture, middle, sigma=sigma, window=(columns, rows), norm=norm, slip=slip)
        for picture in pictures
    ]
    references = jnp.concatenate([each.references for each in alone])
    return dataclasses.replace(alone[0], references=references)


def _seen(frame, poses, sizes, window, names):
    """Windows of objects in a frame, [P, rows * columns, 3]."""
    check_frame(frame)
    check_window("window", window)
    x, y, theta = jnp.asarray(np.asarray(poses, np.float32)).T
    width, height = jnp.asarray(np.asarray(sizes, np.float32)).T
    words = words_of(jnp.asarray(frame))
    seen = window_colours(words, Turned(x, y, width, height, theta), tuple(window))
    _check_not_black(np.asarray(seen), names)
    return seen


def _check_not_black(seen: np.ndarray, names: Sequence[str]) -> None:
    """Refuse windows ``[N, ...]`` that are too dark to be divided by their mean."""
    for name, mean in zip(names, seen.mean(axis=(1, 2)), strict=True):
        if mean < _DARKEST_MEAN:
            raise InputError(
                f"{name} is black, its mean {mean:.2g} of 255, so nothing can be divided by it: "
                "move or enlarge it."
            )


def _of_boxes(seen, sizes, sigma, window) -> PatchLikelihood:
    return PatchLikelihood(
        sigma=_checked(sigma),
        references=as_array(_normalised(seen), float),
        sizes=as_array(sizes.astype(np.float32), float),
        window=tuple(window),
    )


def _checked(sigma: float) -> jax.Array:
    check_number("sigma", float(sigma), above=0)
    return as_array(sigma, float)


def _normalised(seen):
    """o / E[o] of windows [N, ...] of three axes."""
    mean = jnp.mean(seen, axis=(1, 2), keepdims=True)
    return seen / jnp.maximum(mean, _DARKEST_MEAN)


def _matches_elsewhere(frame, points, references, window):
    """e [P] of the log odds, from windows on a grid; None if all of them show a point."""
    columns, rows = window
    blocks = np.lib.stride_tricks.sliding_window_view(frame, (rows, columns), axis=(0, 1))
    top, left = (
        np.unique(np.linspace(0, size - 1, min(_PLACES, 2 * size // side + 2)).astype(int))
        for size, side in zip(blocks.shape[:2], (rows, columns), strict=True)
    )
    seen = np.moveaxis(blocks[np.ix_(top, left)], 2, -1).reshape(len(top) * len(left), -1)
    seen = seen / np.maximum(seen.mean(axis=1, keepdims=True), _DARKEST_MEAN).astype(np.float32)
    references = references.reshape(len(references), -1).astype(np.float32)
    squares = np.sum(references**2, 1)[:, None] + np.sum(seen**2, 1) - 2 * references @ seen.T
    middles = np.stack(np.meshgrid(left + columns // 2, top + rows // 2), axis=-1).reshape(-1, 2)
    away = np.abs(np.floor(points)[:, None] - middles)
    other = np.any(away > np.array(window) // 2, axis=-1)
    if not other.any(axis=1).all():
        return None
    distances = np.where(other, squares / references.shape[1], np.nan)
    return np.maximum(np.nanquantile(distances, _BEST, axis=1), _CLOSEST)


def _neighbours(points, window):
    """The nearest other points, int [P, K], and their distances; None for a single point."""
    if len(points) == 1:
        return None, None
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    np.fill_diagonal(apart, np.inf)
    nearest = np.argsort(apart, axis=1)[:, : min(_NEIGHBOURS, len(points) - 1)]
    lengths = np.maximum(np.take_along_axis(apart, nearest, axis=1), max(window))
    return jnp.asarray(nearest, jnp.int32), as_array(lengths, float)


def _blocks(frame, u, v, window):
    """The pixels around every point: uint8 [N, rows, columns * 3]."""
    height, width, _ = frame.shape
    columns, rows = window
    left = jnp.floor(u).astype(jnp.int32) - columns // 2
    top = jnp.floor(v).astype(jnp.int32) - rows // 2
    # The nearest blocks inside the frame, and how far each is from its window.
    column, row = jnp.clip(left, 0, width - columns), jnp.clip(top, 0, height - rows)
    across, down = left - column, top - row

    def block(row, column):
        return lax.dynamic_slice(frame, (row, column, jnp.int32(0)), (rows, columns, 3))

    def shifted(block, down, across):
        i, j = down + jnp.arange(rows), across + jnp.arange(columns)
        shown = ((i >= 0) & (i < rows))[:, None] & ((j >= 0) & (j < columns))
        block = block[jnp.clip(i, 0, rows - 1)][:, jnp.clip(j, 0, columns - 1)]
        return jnp.where(shown[..., None], block, 0)

    # Most windows are blocks, which cost half as much as pixels with a bounds check each.  A loop
    # of at most one iteration, because under ``vmap`` a branch would compute both sides; it must
    # not use the frame, which a loop would copy.
    _, seen = lax.while_loop(
        lambda carry: carry[0],
        lambda carry: (jnp.array(False), jax.vmap(shifted)(carry[1], down, across)),
        (jnp.any((across != 0) | (down != 0)), jax.vmap(block)(row, column)),
    )
    return seen.reshape(len(seen), rows, columns * 3)


def _check_fits(frame, window):
    height, width = frame.shape[:2]
    if window[0] > width or window[1] > height:
        raise InputError(
            f"the window is {window[0]} x {window[1]} pixels and the frame {width} x {height}: use "
            "a smaller window."
        )
