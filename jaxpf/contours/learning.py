"""Learns the shape space and dynamics of contours from annotated frames."""

from typing import Any

import numpy as np

from jaxpf.contours.data import Annotated, Learned
from jaxpf.contract.errors import InputError
from jaxpf.dynamics.learned import fit
from jaxpf.shapes.learning import augment, learn_shape_space
from jaxpf.shapes.spaces import ShapeSpace, key_frame_space
from jaxpf.shapes.splines import points_on

#: Number of points at which contours are compared.
_POINTS = 64
#: Maximum number of control points: memory and time grow with its square.
_MOST_POINTS = 500


def learn_contours(
    annotated: Annotated,
    *,
    dimension: int = 8,
    num_points: int = 12,
    order: int = 2,
    coefficients: str = "steps",
    turns: int = 0,
) -> tuple[Learned, list[str]]:
    """Learn shapes and motion from annotated contours, pooled over all targets.

    Args:
        annotated: from ``jaxpf.contours.annotated_files``.
        dimension: D, of the shape space.
        num_points: K, control points of a contour.
        order: of the dynamics, 1 or 2; 0 learns none.
        coefficients: see ``jaxpf.dynamics.fit``.
        turns: of centrelines, number of directions for data augmentation by rotation, mirroring
            and reversal (``jaxpf.shapes.learning.augment``); 0 for no augmentation.

    Returns:
        The learned model, and sentences on its fit.

    Raises:
        InputError: too few contours for the dimension, too few frames for the dynamics, too many
            control points, or turns of closed contours.
    """
    if num_points > _MOST_POINTS:
        raise InputError(
            f"{num_points} control points are too many to learn from; give {_MOST_POINTS} at most."
        )
    space, control = learn_shape_space(
        list(annotated.lines.values()),
        annotated.kind,
        num_points=num_points,
        dimension=dimension,
        ordered=annotated.kind != "masks",
    )
    if turns:
        if space.closed:
            raise InputError(
                f"turns {turns} are of centrelines, and {annotated.kind} were given; leave them "
                "out."
            )
        space = key_frame_space(augment(control, turns), dimension, closed=False)
    keys = list(annotated.lines)
    tracks = _tracks(space, keys, control)
    report = [_followed(space, control, tracks)]
    if order == 0:
        return Learned(space, None), report
    dynamics = fit(tracks, order, coefficients=coefficients, pooled=True)
    noise = np.linalg.norm(np.asarray(dynamics.noise)[0], axis=1)
    report.append(
        f"Dynamics of order {order}; noise of each coordinate per frame, pixels: "
        f"{', '.join(f'{value:.2f}' for value in noise)}."
    )
    return Learned(space, dynamics), report


def _tracks(space: ShapeSpace, keys: list[tuple[int, str]], control: np.ndarray) -> np.ndarray:
    """``[T, P, D]``, NaN where nothing is marked."""
    frames, names = [frame for frame, _ in keys], sorted({name for _, name in keys})
    first = min(frames)
    tracks = np.full((max(frames) - first + 1, len(names), space.dimension), np.nan)
    for place, name in enumerate(names):
        chosen = [k for k, (_, whose) in enumerate(keys) if whose == name]
        times = [frames[k] - first for k in chosen]
        tracks[times, place] = space.project(control[chosen][:, None])[:, 0]
    return tracks


def _followed(space: ShapeSpace, control: np.ndarray, tracks: np.ndarray) -> str:
    drawn = np.asarray(space.control_points(space.project(control[:, None])))
    kind: dict[str, Any] = {"closed": space.closed, "degree": space.degree}
    gaps = points_on(drawn[:, 0], _POINTS, **kind) - points_on(control, _POINTS, **kind)
    kept = f", which hold them to {np.sqrt(np.mean(np.sum(gaps**2, axis=-1))):.2f} pixels"
    return (
        f"{len(control)} contour(s) of {tracks.shape[1]} target(s) in {len(tracks)} frame(s): "
        f"{space.dimension} dimensions{kept}."
    )
