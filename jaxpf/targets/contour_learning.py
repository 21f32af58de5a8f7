"""Shape space and dynamics of contours, learned from annotated frames."""

from typing import Any

import numpy as np

from jaxpf.errors import InputError
from jaxpf.files.annotated_contours import Annotated
from jaxpf.files.learned_contours import Learned
from jaxpf.models.bending import bending_space
from jaxpf.models.learned_dynamics import fit
from jaxpf.models.shape_learning import learn_shape_space
from jaxpf.models.splines import fit_spline
from jaxpf.names import LEARNED_SPACES


def learn_contours(
    annotated: Annotated,
    *,
    space: str = "key_frames",
    dimension: int = 8,
    num_points: int = 12,
    order: int = 2,
    coefficients: str = "steps",
) -> tuple[Learned, list[str]]:
    """What annotated contours look like and how they move, all targets together.

    Args:
        annotated: from ``jaxpf.files.annotated_contours``.
        space: of ``jaxpf.names.LEARNED_SPACES``; ``"bending"`` is for centrelines.
        dimension: D, of the shape space.
        num_points: K, control points of a contour.
        order: of the dynamics, 1 or 2; 0 learns none.
        coefficients: see ``jaxpf.dynamics.fit``.

    Returns:
        What was learned, and sentences on how well.

    Raises:
        InputError: too few contours for the dimension, too few frames for the dynamics, or a
            space that does not go with the annotation.
    """
    if space not in LEARNED_SPACES:
        raise InputError(f"space {space!r} is unknown; choose one of {', '.join(LEARNED_SPACES)}.")
    keys, lines = list(annotated.lines), list(annotated.lines.values())
    found: Any
    if space == "bending":
        if annotated.kind != "centrelines":
            raise InputError(
                f"a space of bending bodies is learned from centrelines, not from {annotated.kind};"
                " use key_frames."
            )
        found = bending_space(lines, dimension, num_points=num_points)
        control = np.array([fit_spline(line, num_points, closed=False) for line in lines])
    else:
        found, control = learn_shape_space(
            lines,
            annotated.kind,
            num_points=num_points,
            dimension=dimension,
            ordered=annotated.kind != "masks",
        )
    tracks = _tracks(found, keys, control)
    report = [_followed(found, control, tracks)]
    if order == 0:
        return Learned(found, None), report
    dynamics = fit(tracks, order, coefficients=coefficients, pooled=True)
    noise = np.linalg.norm(np.asarray(dynamics.noise)[0], axis=1)
    report.append(
        f"Dynamics of order {order}; noise of each coordinate per frame, pixels: "
        f"{', '.join(f'{value:.2f}' for value in noise)}."
    )
    return Learned(found, dynamics), report


def _tracks(space: Any, keys: list[tuple[int, str]], control: np.ndarray) -> np.ndarray:
    """``[T, P, D]``, NaN where nothing is marked."""
    frames, names = [frame for frame, _ in keys], sorted({name for _, name in keys})
    first = min(frames)
    tracks = np.full((max(frames) - first + 1, len(names), space.dimension), np.nan)
    for place, name in enumerate(names):
        chosen = [k for k, (_, whose) in enumerate(keys) if whose == name]
        times = [frames[k] - first for k in chosen]
        # Together, since angles go on from frame to frame.
        tracks[times, place] = space.project(control[chosen][:, None])[:, 0]
    return tracks


def _followed(space: Any, control: np.ndarray, tracks: np.ndarray) -> str:
    drawn = np.asarray(space.control_points(tracks[np.isfinite(tracks).all(axis=-1)][:, None]))
    gaps = np.linalg.norm(drawn[:, 0] - control, axis=-1) if len(drawn) == len(control) else None
    kept = "" if gaps is None else f", which hold them to {np.sqrt(np.mean(gaps**2)):.2f} pixels"
    return (
        f"{len(control)} contour(s) of {tracks.shape[1]} target(s) in {len(tracks)} frame(s): "
        f"{space.dimension} dimensions{kept}."
    )
