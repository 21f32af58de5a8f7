"""Window likelihood of points: compare the pixels around a point with those at the start.

Source: eskil2014, eq. 6 and 7, the same rule as ``jaxpf.likelihoods.patch``.  A substate is a
point (u, v, ...), rounded to whole pixels; windows do not rotate or grow.  So a window is one
block of the frame, and the rest of the frame needs no processing.

``log_odds_all`` says whether points are where they are reported.  With d the mean squared
difference between a point's window and its reference, e the 5% quantile of d at other places of
the start frame, and s the median strain to the three points that were nearest at the start (the
difference of two points' displacements over their distance at the start, at least a window)::

    log odds = -1.4 - 1.2 log(d / e) - 1.0 log(s + .05)

or, for a single point, ``-1.1 - 1.4 log(d / e)``.  Fitted by logistic regression to "within 21
pixels of the label" on two clips, a walking bear and a head with two hands, each with the same
weight; points further off count 1.25 times.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf.contract import Likelihood
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.names import NORMS
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.contract.ranges import check_ranges
from jaxpf.likelihoods._checks import (
    DARKEST_MEAN,
    check_not_black,
    check_pictures,
    check_window,
    points_in,
)
from jaxpf.likelihoods.color import check_frame

#: Of the log odds: constant, and factors of log(d / e) and log(s + .05).
_ODDS = -1.4, -1.2, -1.0
#: The same for a single point.
_ODDS_ALONE = -1.1, -1.4
#: Number of neighbours whose strain is measured, and strain that counts as none.
_NEIGHBOURS, _STIFF = 3, 0.05
#: Share of the other places that match better than e; smallest d; most places per side of the grid.
_BEST, _CLOSEST, _PLACES = 0.05, 1e-4, 48


@pytree_dataclass
class WindowLikelihood(Likelihood):
    """Window likelihood of P points; make one with :func:`windows`.

    A substate is (u, v, ...): pixels from the left and the top of the frame, in which pixel (i, j)
    is the square [j, j + 1) x [i, i + 1).  The window is centred on the pixel that contains the
    point; pixels outside the frame are black.

    Attributes:
        sigma: scalar, sigma_o.
        references: [P, rows, columns * 3], r / E[r].
        window: (columns, rows), odd numbers.
        norm: ``"mean"`` (squares are averaged over the window's entries) or ``"sum"``, the
            literal rule, whose exponent is 1323 times as large for 21 x 21 pixels.
        slip: standard deviation in pixels of a point around the window that matches best, because
            surfaces turn and skin slides; the ``model_error`` of x and y.
        elsewhere: [P], e of the log odds; None if the surroundings are unknown, and then there are
            no log odds.
        places: [P, 2], the points at the start.
        neighbours: int [P, K], the nearest other points at the start; None for a single point.
        lengths: [P, K], their distances at the start, at least a window; None likewise.
    """

    sigma: ArrayLike
    references: jax.Array
    window: tuple[int, int] = static_field(default=(21, 21))
    norm: str = static_field(default="mean")
    slip: ArrayLike = 0.0
    elsewhere: jax.Array | None = None
    places: Any = None
    neighbours: Any = None
    lengths: jax.Array | None = None

    #: ``log_prob`` is constant within a pixel.
    state_gradient = False
    fixed_observation = True

    @property
    def model_error(self):
        """See ``Likelihood``."""
        return self.slip, self.slip, 0.0

    def observe(self, frame):
        """The frame itself, uint8 [H, W, 3].

        Raises:
            InputError: the frame is not uint8 RGB, or smaller than the window.
        """
        check_frame(frame)
        _check_fits(frame, self.window)
        return jnp.asarray(frame)

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods [N] of substates [D, N]; NaN if u or v is not finite."""
        squares, finite = self._squares(observation, partition, substates)
        total = jnp.mean if self.norm == "mean" else jnp.sum
        log_prob = -total(squares, axis=(1, 2)) / jnp.asarray(self.sigma, squares.dtype) ** 2
        return jnp.where(finite, log_prob, jnp.nan)

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
        squares, finite = self._squares(observation, partition, substates)
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
        """Squared differences [N, rows, columns * 3], and whether u and v are finite."""
        dtype = substates.dtype
        finite = jnp.all(jnp.isfinite(substates[:2]), axis=0)
        # Far outside everything is black anyway; clip so that the cast to int32 cannot overflow.
        u, v = jnp.where(finite, jnp.clip(substates[:2], -1e6, 1e6), 0.0)
        seen = _windows(observation, u, v, self.window).astype(dtype)
        mean = jnp.mean(seen, axis=(1, 2), keepdims=True)
        seen = seen / jnp.maximum(mean, DARKEST_MEAN)
        return (jnp.asarray(self.references, dtype)[partition] - seen) ** 2, finite


def windows(
    frame,
    points,
    *,
    sigma: float = 0.1,
    window: tuple[int, int] = (21, 21),
    norm: str = "mean",
    slip: float = 0.0,
) -> WindowLikelihood:
    """Learn the likelihood of P points from their windows in one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        points: [P, 2], x and y in pixels, inside the frame.
        sigma: smaller is sharper; .1 in eskil2014, with ``norm="sum"``.
        window: columns and rows, odd numbers (eskil2014: 21 x 21).
        norm: ``"mean"`` or ``"sum"``, see :class:`WindowLikelihood`.
        slip: see there.

    Raises:
        InputError: an argument is out of range, a point lies outside the frame, or a window is
            black or larger than the frame.
    """
    check_frame(frame)
    check_ranges(sigma=sigma)
    check_known("norm=", norm, NORMS)
    check_window(window, "(21, 21)")
    if not all(n % 2 for n in window):
        raise InputError(f"window is {window!r}: give two odd numbers of pixels, such as (21, 21).")
    _check_fits(frame, window)
    points = points_in(points, frame.shape[:2])
    u, v = jnp.asarray(points).T
    size = int(window[0]), int(window[1])
    seen = np.asarray(_windows(jnp.asarray(frame), u, v, size), np.float32)
    check_not_black(seen, [f"the window of point {i}" for i in range(len(points))])
    learned = _build(seen, sigma, size, norm, slip)
    neighbours, lengths = _neighbours(points, size)
    elsewhere = _matches_elsewhere(np.asarray(frame), points, np.asarray(learned.references), size)
    if elsewhere is None:
        return learned
    return dataclasses.replace(
        learned,
        elsewhere=as_array(elsewhere, float),
        places=as_array(points, float),
        neighbours=neighbours,
        lengths=lengths,
    )


def windows_from_pictures(
    pictures, *, sigma: float = 0.1, norm: str = "mean", slip: float = 0.0
) -> WindowLikelihood:
    """Learn the likelihood of P points from pictures of their surroundings.

    Args:
        pictures: P pictures of one size, uint8 RGB [rows, columns, 3], rows and columns odd.
        sigma: see :func:`windows`.
        norm, slip: see there.

    Raises:
        InputError: as :func:`windows`.
    """
    check_pictures("pictures", pictures)
    seen = []
    for i, picture in enumerate(pictures):
        rows, columns = picture.shape[:2]
        if picture.shape != pictures[0].shape:
            raise InputError(f"pictures[{i}] has another size than pictures[0]: give all one size.")
        middle = [[columns // 2 + 0.5, rows // 2 + 0.5]]
        likelihood = windows(picture, middle, sigma=sigma, window=(columns, rows), norm=norm)
        seen.append(likelihood.references[0])
    return _build(np.stack(seen), sigma, likelihood.window, norm, slip)


def _build(seen, sigma, window, norm, slip) -> WindowLikelihood:
    check_ranges(slip=slip)
    means = seen.mean(axis=(1, 2), keepdims=True)
    return WindowLikelihood(
        sigma=as_array(sigma, float),
        references=as_array(seen / means, float),
        window=window,
        norm=norm,
        slip=as_array(slip, float),
    )


def _matches_elsewhere(frame, points, references, window):
    """e [P] of the log odds, from windows on a grid; None if all of them show a point."""
    columns, rows = window
    blocks = np.lib.stride_tricks.sliding_window_view(frame, (rows, columns), axis=(0, 1))
    top, left = (
        np.unique(np.linspace(0, size - 1, min(_PLACES, 2 * size // side + 2)).astype(int))
        for size, side in zip(blocks.shape[:2], (rows, columns), strict=True)
    )
    seen = np.moveaxis(blocks[np.ix_(top, left)], 2, -1).reshape(len(top) * len(left), -1)
    seen = seen / np.maximum(seen.mean(axis=1, keepdims=True), DARKEST_MEAN).astype(np.float32)
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


def _windows(frame, u, v, window):
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
