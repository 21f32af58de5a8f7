"""Trajectories of the distracter scene: separate objects that stay in view, and a distracter."""

import numpy as np

from scenes.distracter_parameters import DistracterParameters
from scenes.scene import SceneError

_TRIES_PER_OBJECT = 100
_TRIES_PER_LEADER = 2000  # for a rare trajectory
_TRIES_PER_LAYOUT = 50


def draw_layout(
    parameters: DistracterParameters, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Centres of the objects ``[T, P, 2]`` and of the distracter ``[T, 2]``."""
    cells, room = _grid(parameters)
    for _ in range(_TRIES_PER_LAYOUT):
        start = rng.permutation(cells)[: parameters.num_objects]
        start = start + parameters.start_jitter * room * rng.uniform(-1, 1, start.shape)
        layout = _try_layout(parameters, start, rng)
        if layout is not None:
            return layout
    raise SceneError(
        f"distracter scene: {parameters.num_objects} objects of {parameters.object_width} x "
        f"{parameters.object_height} pixels do not stay apart and in view for "
        f"{parameters.num_frames} frames of {parameters.frame_width} x {parameters.frame_height}; "
        "take fewer or smaller objects, less motion_scale, separation, lead_distance or departure, "
        "or a larger frame"
    )


def _grid(parameters: DistracterParameters) -> tuple[np.ndarray, np.ndarray]:
    """Centres of the start cells ``[cells, 2]``, and the free space on each side of a cell."""
    aspect = parameters.frame_width / parameters.frame_height
    columns = int(np.ceil(np.sqrt(parameters.num_objects * aspect)))
    rows = int(np.ceil(parameters.num_objects / columns))
    cell = np.array([parameters.frame_width / columns, parameters.frame_height / rows])
    indices = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    gap = parameters.separation + 2 * parameters.frame_margin
    size = np.array([parameters.object_width, parameters.object_height])
    return (indices + 0.5) * cell, np.maximum(cell - size - gap, 0) / 2


def _try_layout(
    parameters: DistracterParameters, start: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray] | None:
    """Place the objects one by one, each clear of the previous ones; ``None`` if one fails."""
    leader = distracter = None
    tries = _TRIES_PER_LEADER if parameters.departure > 0 else _TRIES_PER_OBJECT
    for _ in range(tries):
        candidate = _draw_trajectory(parameters, start[0], rng)
        shadow, travel = _lead_away(parameters, candidate)
        if (
            travel >= parameters.leader_travel
            and _departs(parameters, candidate, shadow)
            and _is_in_view(parameters, candidate)
            and _is_in_view(parameters, shadow)
        ):
            leader, distracter = candidate, shadow
            break
    if leader is None or distracter is None:
        return None
    placed = [leader]
    for position in start[1:]:
        for _ in range(_TRIES_PER_OBJECT):
            candidate = _draw_trajectory(parameters, position, rng)
            if _is_in_view(parameters, candidate) and all(
                _are_apart(parameters, candidate, other) for other in [*placed, distracter]
            ):
                placed.append(candidate)
                break
        else:
            return None
    return np.stack(placed, axis=1), distracter


def _draw_trajectory(
    parameters: DistracterParameters, start: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """``[T, 2]``: second-order autoregressive motion (smith2004, section 2), started at rest."""
    noise = parameters.motion_scale * rng.standard_normal((parameters.num_frames, 2))
    return np.stack(
        [_autoregression(start[k], noise[:, k], parameters.momentum) for k in (0, 1)], axis=-1
    )


def _autoregression(start: float, noise: np.ndarray, momentum: float) -> list[float]:
    """One coordinate, in plain floats, because arrays of two would be ten times slower."""
    positions = []
    previous = current = float(start)
    for step in noise.tolist():
        positions.append(current)
        previous, current = current, current + momentum * (current - previous) + step
    return positions


def _lead_away(
    parameters: DistracterParameters, trajectory: np.ndarray
) -> tuple[np.ndarray, float]:
    """The distracter's centres ``[T, 2]``, NaN while it is absent, and object 1's displacement.

    The path is straight, back where object 1 came from, and ends at a given distance from it, so
    that every seed has the same gap between the correct and the wrong answer.
    """
    first = parameters.appear_frame - 1
    last = min(parameters.vanish_frame - 1, parameters.num_frames) - 1
    frames = np.arange(parameters.num_frames)
    is_shown = (frames >= first) & (frames <= last)
    if not is_shown.any():  # the sequence ends before the distracter appears
        return np.full_like(trajectory, np.nan), np.inf
    moved = trajectory[last] - trajectory[first]
    travel = float(np.hypot(*moved))
    heading = -moved / travel if travel > 0 else np.array([1.0, 0.0])
    end = trajectory[last] + parameters.lead_distance * heading
    progress = (frames - first) / max(last - first, 1)
    path = trajectory[first] + progress[:, None] * (end - trajectory[first])
    return np.where(is_shown[:, None], path, np.nan), travel


def _departs(
    parameters: DistracterParameters, trajectory: np.ndarray, distracter: np.ndarray
) -> bool:
    """Whether object 1 ends far enough from where the distracter vanished."""
    shown = np.flatnonzero(~np.isnan(distracter[:, 0]))
    if len(shown) == 0:
        return True
    offset = trajectory[-1] - distracter[shown[-1]]
    return float(np.hypot(*offset)) >= parameters.departure


def _is_in_view(parameters: DistracterParameters, centres: np.ndarray) -> bool:
    """Whether the box stays in the frame; NaN frames are ignored."""
    half = np.array([parameters.object_width, parameters.object_height]) / 2
    frame = np.array([parameters.frame_width, parameters.frame_height])
    reach = half + parameters.frame_margin
    return not np.any((centres < reach) | (centres > frame - reach))


def _are_apart(parameters: DistracterParameters, path: np.ndarray, other: np.ndarray) -> bool:
    """Whether the gap is kept in every frame; NaN frames are ignored."""
    size = np.array([parameters.object_width, parameters.object_height])
    return not np.any(np.all(np.abs(path - other) < size + parameters.separation, axis=-1))
