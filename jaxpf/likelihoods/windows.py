"""Window likelihood of points: compare the pixels around a point with those at the start.

Source: eskil2014, eq. 6 and 7, the same rule as ``jaxpf.likelihoods.patch``.  A substate is a
point (u, v, ...), rounded to whole pixels; windows do not rotate or grow.  So a window is one
block of the frame, and the rest of the frame needs no processing.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.contract import Likelihood
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.likelihoods._checks import NORMS, check_choice, check_positive
from jaxpf.likelihoods.color import check_frame

# Lower bound of the mean, of 255, by which a window is divided; as in ``patch``.
_DARKEST_MEAN = 1.0


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
    """

    sigma: Any
    references: Any
    window: tuple[int, int] = static_field(default=(21, 21))
    norm: str = static_field(default="mean")

    #: ``log_prob`` is constant within a pixel.
    state_gradient = False
    fixed_observation = True

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
        dtype = substates.dtype
        finite = jnp.all(jnp.isfinite(substates[:2]), axis=0)
        # Far outside everything is black anyway; clip so that the cast to int32 cannot overflow.
        u, v = jnp.where(finite, jnp.clip(substates[:2], -1e6, 1e6), 0.0)
        seen = _windows(observation, u, v, self.window).astype(dtype)
        mean = jnp.mean(seen, axis=(1, 2), keepdims=True)
        seen = seen / jnp.maximum(mean, _DARKEST_MEAN)
        squares = (jnp.asarray(self.references, dtype)[partition] - seen) ** 2
        total = jnp.mean if self.norm == "mean" else jnp.sum
        log_prob = -total(squares, axis=(1, 2)) / jnp.asarray(self.sigma, dtype) ** 2
        return jnp.where(finite, log_prob, jnp.nan)


def windows(
    frame,
    points,
    *,
    sigma: float = 0.1,
    window: tuple[int, int] = (21, 21),
    norm: str = "mean",
) -> WindowLikelihood:
    """Learn the likelihood of P points from their windows in one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        points: [P, 2], x and y in pixels, inside the frame.
        sigma: smaller is sharper; .1 in eskil2014, with ``norm="sum"``.
        window: columns and rows, odd numbers (eskil2014: 21 x 21).
        norm: ``"mean"`` or ``"sum"``, see :class:`WindowLikelihood`.

    Raises:
        InputError: an argument is out of range, a point lies outside the frame, or a window is
            black or larger than the frame.
    """
    check_frame(frame)
    check_positive("sigma", sigma)
    check_choice("norm", norm, NORMS)
    if len(window) != 2 or not all(isinstance(n, int) and n >= 1 and n % 2 for n in window):
        raise InputError(f"window is {window!r}: give two odd numbers of pixels, such as (21, 21).")
    _check_fits(frame, window)
    points = np.asarray(points, np.float32)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) == 0:
        raise InputError(f"points has shape {list(points.shape)}: give a row (x, y) per point.")
    height, width = frame.shape[:2]
    for i, (x, y) in enumerate(points):
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(
                f"point {i} is at ({x:g}, {y:g}), outside the frame of {width} x {height} pixels: "
                "move it inside, or leave it out."
            )
    u, v = jnp.asarray(points).T
    size = int(window[0]), int(window[1])
    seen = np.asarray(_windows(jnp.asarray(frame), u, v, size), np.float32)
    for i, mean in enumerate(seen.mean(axis=(1, 2))):
        if mean < _DARKEST_MEAN:
            raise InputError(
                f"the window of point {i} is black, its mean {mean:.2g} of 255, so nothing can be "
                "divided by it: move the point or enlarge the window."
            )
    return _build(seen, sigma, size, norm)


def windows_from_pictures(pictures, *, sigma: float = 0.1, norm: str = "mean") -> WindowLikelihood:
    """Learn the likelihood of P points from pictures of their surroundings.

    Args:
        pictures: P pictures of one size, uint8 RGB [rows, columns, 3], rows and columns odd.
        sigma: see :func:`windows`.
        norm: see there.

    Raises:
        InputError: as :func:`windows`.
    """
    if len(pictures) == 0:
        raise InputError("pictures is empty: give one picture per point.")
    seen = []
    for i, picture in enumerate(pictures):
        rows, columns = picture.shape[:2]
        if picture.shape != pictures[0].shape:
            raise InputError(f"pictures[{i}] has another size than pictures[0]: give all one size.")
        middle = [[columns // 2 + 0.5, rows // 2 + 0.5]]
        one = windows(picture, middle, sigma=sigma, window=(columns, rows), norm=norm)
        seen.append(one.references[0])
    return _build(np.stack(seen), sigma, one.window, norm)


def _build(seen, sigma, window, norm) -> WindowLikelihood:
    means = seen.mean(axis=(1, 2), keepdims=True)
    return WindowLikelihood(
        sigma=as_array(sigma, float),
        references=as_array(seen / means, float),
        window=window,
        norm=norm,
    )


def _windows(frame, u, v, window):
    """The pixels around every point: uint8 [N, rows, columns * 3]."""
    height, width, _ = frame.shape
    columns, rows = window
    left = jnp.floor(u).astype(jnp.int32) - columns // 2
    top = jnp.floor(v).astype(jnp.int32) - rows // 2
    inside = (left >= 0) & (left <= width - columns) & (top >= 0) & (top <= height - rows)

    def blocks():
        def block(y, x):
            return lax.dynamic_slice(frame, (y, x, 0), (rows, columns, 3))

        return jax.vmap(block)(top, left)

    def pixels():
        row = top[:, None] + jnp.arange(rows)
        column = left[:, None] + jnp.arange(columns)
        shown = ((row >= 0) & (row < height))[:, :, None] & ((column >= 0) & (column < width))[
            :, None
        ]
        row, column = jnp.clip(row, 0, height - 1), jnp.clip(column, 0, width - 1)
        seen = frame[row[:, :, None], column[:, None, :]]
        return jnp.where(shown[..., None], seen, 0)

    # Whole blocks cost half as much as pixels with a bounds check each.  A loop of at most one
    # iteration, because under ``vmap`` a branch would compute both sides.
    _, seen = lax.while_loop(
        lambda carry: carry[0],
        lambda carry: (jnp.array(False), pixels()),
        (~jnp.all(inside), blocks()),
    )
    return seen.reshape(len(seen), rows, columns * 3)


def _check_fits(frame, window):
    height, width = frame.shape[:2]
    if window[0] > width or window[1] > height:
        raise InputError(
            f"the window is {window[0]} x {window[1]} pixels and the frame {width} x {height}: use "
            "a smaller window."
        )
