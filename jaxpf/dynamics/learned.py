"""Dynamics learned from tracks: autoregression by maximum likelihood.

Source: Blake and Isard, Active Contours, 1998, chapter 11.  Conditional on the first frames, the
maximum-likelihood solution is least squares, and the noise covariance is that of the residuals.
Unlike the Yule-Walker equations it handles non-stationary tracks, which are usual in video.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_whole, with_nan
from jaxpf.contract.pytree import as_array
from jaxpf.dynamics.gaussian import LinearGaussian

#: What a coordinate depends on: its own last steps; its own past, with a mean to which it returns;
#: or the past of all coordinates.
COEFFICIENTS = ("steps", "own", "all")


def fit(
    tracks: ArrayLike | Sequence[ArrayLike],
    order: int = 2,
    *,
    coefficients: str = "steps",
    pooled: bool = False,
) -> LinearGaussian:
    """Fit the autoregression ``x_t = A x_{t-1} + B x_{t-2} + b + L n`` to tracks.

    Args:
        tracks: ``[T, P, D]``, or several with the same P and D, in the substate's units.  Frames
            with a NaN are dropped, and so are steps across them.
        order: 1 or 2.
        coefficients: one of ``COEFFICIENTS``.  ``"steps"``: a coordinate stays where it was
            (order 1), or repeats a share of its last step (order 2: smith2004's AR2 with one
            momentum per coordinate).  ``"own"``: free multiples of its own past, and an offset.
            ``"all"``: full matrices and an offset.
        pooled: fit one dynamics to the tracks of all targets; otherwise one per target.

    Returns:
        Dynamics of P partitions, with a full noise covariance.

    Raises:
        InputError: an argument is out of range, or there are too few frames to fit.
    """
    check_whole("order", order, 1, 2)
    check_known("coefficients=", coefficients, COEFFICIENTS)
    each: Any = tracks
    if not (isinstance(tracks, list | tuple) and np.ndim(tracks[0]) == 3):
        each = [tracks]
    pieces = [np.asarray(with_nan(piece), float) for piece in each]
    if len({piece.shape[1:] for piece in pieces}) > 1:
        raise InputError("tracks [T, P, D] must have the same P and D.")
    num_targets = pieces[0].shape[1]
    groups = [list(range(num_targets))] if pooled else [[target] for target in range(num_targets)]
    fits: dict[int, tuple[np.ndarray, ...]] = {}
    for targets in groups:
        examples = [_triples(piece[:, target], order) for piece in pieces for target in targets]
        fitted = _fit_one(np.concatenate(examples), order, coefficients, targets)
        fits |= dict.fromkeys(targets, fitted)
    transition, lag, offset, noise = (
        as_array(np.stack([fits[target][k] for target in range(num_targets)]), float)
        for k in range(4)
    )
    return LinearGaussian(
        transition=transition, noise=noise, lag=lag if order == 2 else None, offset=offset
    )


def _triples(track: np.ndarray, order: int) -> np.ndarray:
    """``[n, order + 1, D]``: consecutive substates, oldest first, without NaN."""
    count = max(len(track) - order, 0)
    every = np.stack([track[k : k + count] for k in range(order + 1)], axis=1)
    return every[np.isfinite(every).all(axis=(1, 2))]


def _fit_one(examples, order, coefficients, targets) -> tuple[np.ndarray, ...]:
    """A, B, b and L of one group of targets."""
    dimension = examples.shape[2]
    new, last = examples[:, -1], examples[:, -2]
    learned = {"steps": order - 1, "own": order + 1, "all": order * dimension + 1}[coefficients]
    if len(examples) < learned + dimension + 1:
        name = f"target {targets[0]}" if len(targets) == 1 else "all targets together"
        raise InputError(
            f"{len(examples)} steps of {name} are too few to learn {learned} coefficients and the "
            f"noise of each of {dimension} coordinates; give {learned + dimension + 1} or more, "
            "pool the targets, or learn fewer coefficients."
        )
    transition, lag = np.zeros((2, dimension, dimension))
    offset = np.zeros(dimension)
    if coefficients == "all":
        past = np.concatenate([last, examples[:, 0]], axis=1) if order == 2 else last
        fitted = _least_squares(np.column_stack([past, np.ones(len(new))]), new)
        transition = fitted[:dimension].T
        lag = fitted[dimension : 2 * dimension].T if order == 2 else lag
        offset = fitted[-1]
    for k in range(dimension) if coefficients != "all" else ():
        momentum, stay = 0.0, 1.0
        if coefficients == "own":
            past = [last[:, k], examples[:, 0, k]] if order == 2 else [last[:, k]]
            fitted = _least_squares(np.column_stack([*past, np.ones(len(new))]), new[:, k])
            stay, offset[k] = fitted[0], fitted[-1]
            lag[k, k] = fitted[1] if order == 2 else 0.0
        elif order == 2:
            step = last[:, k] - examples[:, 0, k]
            moved = step @ step
            momentum = step @ (new[:, k] - last[:, k]) / moved if moved > 0 else 0.0
            lag[k, k] = -momentum
        transition[k, k] = stay + momentum
    left = new - last @ transition.T - examples[:, 0] @ lag.T * (order == 2) - offset
    covariance = left.T @ left / (len(new) - learned)
    # A coordinate that never moves makes the covariance singular; the square root must still exist.
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    _, upper = np.linalg.qr(root.T)
    signs = np.where(np.diagonal(upper) < 0, -1.0, 1.0)
    return transition, lag, offset, upper.T * signs


def _least_squares(design: np.ndarray, target: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(design, target, rcond=None)[0]
