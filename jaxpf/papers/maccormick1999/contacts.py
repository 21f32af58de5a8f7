"""Contacts of worms composed from a filmed pair: sequences on which settings are chosen.

A clip shows two worms that meet once.  Their shapes, their motion and their looks make as many
other meetings as are wanted: each worm of a new pair is one of the two, in a stretch of its track,
perhaps backwards, mirrored or from the other end, turned and carried along a straight path, so that
the two are in contact for ``CONTACT`` frames.  They are drawn as the clip was composed, by the
darker pixel.
"""

import functools
from pathlib import Path

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.papers.maccormick1999.scenes import (
    LEARNED_FRAMES,
    TRACKED_FRAMES,
    Case,
    case_of_worms,
    read_worms,
)

#: In how many frames the two touch, from the fewest to the most.
CONTACT = 20, 60
#: Frames clear of contact after tracking began, and before it ends.
_CLEAR = 3, 12
#: Middle lines nearer than this touch, pixels: the width of a worm.
_TOUCHING = 16.0
#: Height and width of what is composed, grey level of what is behind, and the noise of its pixels.
_SIZE, _BEHIND, _NOISE = (320, 480), 147.0, 4.0
#: Points along a body and beyond each of its ends, about a pixel apart, and how far to either side
#: its looks are learned, pixels.
_ALONG, _BEYOND, _ASIDE = 160, 12, 16.0
_ACROSS = np.arange(-_ASIDE, _ASIDE + 0.25, 0.5)
#: Pairs that are tried before a folder is given up.
_TRIES = 5000


@functools.lru_cache(maxsize=16)  # a search asks for the same ones with every setting
def contact(data: Path, clip: str, seed: int) -> Case:
    """A composed meeting of a clip's two worms, as ``scenes.worms`` has the filmed one.

    Args:
        data: see ``scenes.worms``.
        clip: whose worms.
        seed: of everything that is drawn.

    Raises:
        InputError: the clip is missing, or its worms make no such contact.
    """
    lines, looks = _filmed(data, clip)
    rng = np.random.default_rng(seed)
    for _ in range(_TRIES):
        worms = [_one(rng, lines) for _ in range(2)]
        placed = _placed(rng, [line for line, _, _, _ in worms])
        if placed is None or not _is_wanted(placed):
            continue
        textures = []
        for _, worm, from_other_end, mirrored in worms:
            texture = looks[worm][::-1] if from_other_end else looks[worm]
            textures.append(texture[:, ::-1] if from_other_end != mirrored else texture)
        pictures = [
            np.minimum(*(_drawn(*one) for one in zip(pair, textures, strict=True)))
            for pair in placed
        ]
        noisy = np.stack(pictures) + rng.normal(0, _NOISE, (len(pictures), *_SIZE))
        grey = np.clip(noisy, 0, 255).astype(np.uint8)
        return case_of_worms(f"{clip}, contact {seed}", np.repeat(grey[..., None], 3, -1), placed)
    low, high = CONTACT
    raise InputError(
        f"{clip}: of {_TRIES} pairs none is in contact for {low} to {high} frames; name a clip of "
        "two worms that move."
    )


def _one(rng: np.random.Generator, lines: np.ndarray) -> tuple[np.ndarray, int, bool, bool]:
    """A stretch of a track ``[T, S, 2]`` about the origin, whose it is, and how it was changed."""
    count = LEARNED_FRAMES + TRACKED_FRAMES
    worm = int(rng.integers(2))
    track = lines[:, worm] if rng.random() < 0.5 else lines[::-1, worm]
    begin = rng.integers(len(track) - count + 1)
    track = track[begin : begin + count]
    track = track - track.mean(axis=(0, 1))
    from_other_end, mirrored = rng.random() < 0.5, rng.random() < 0.5
    if from_other_end:
        track = track[:, ::-1]
    if mirrored:
        track = track * [1.0, -1.0]
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return track @ turn.T, worm, from_other_end, mirrored


def _placed(rng: np.random.Generator, tracks: list[np.ndarray]) -> np.ndarray | None:
    """Two tracks on paths that cross, ``[T, 2, S, 2]``; None where they leave the frame."""
    count = len(tracks[0])
    meeting = int(rng.integers(count - 43, count - 29))
    angle, speed = rng.uniform(0, 2 * np.pi), rng.uniform(0.6, 2.0)
    apart = 0.5 * speed * np.array([np.cos(angle), np.sin(angle)])
    carried = (np.arange(count) - meeting)[:, None, None] * apart
    one, other = (track - track[meeting].mean(axis=0) for track in tracks)
    pair = np.stack([one + carried, other - carried + rng.uniform(-25, 25, 2)], axis=1)
    low, high = pair.min(axis=(0, 1, 2)), pair.max(axis=(0, 1, 2))
    if (high - low > np.array(_SIZE[::-1]) - 20.0).any():
        return None
    return pair - (low + high) / 2 + np.array(_SIZE[::-1]) / 2


def _is_wanted(pair: np.ndarray) -> bool:
    """Whether the two are in contact for so long, and at no other time."""
    touching = np.array([_distance(*both) < _TOUCHING for both in pair])
    before, after = LEARNED_FRAMES - 1 + _CLEAR[0], len(pair) - _CLEAR[1]
    clear = not touching[:before].any() and not touching[after:].any()
    return clear and CONTACT[0] <= touching.sum() <= CONTACT[1]


def _distance(one: np.ndarray, other: np.ndarray) -> float:
    gaps = _along(one, 60)[:, None] - _along(other, 60)
    return float(np.linalg.norm(gaps, axis=-1).min())


@functools.lru_cache(maxsize=2)
def _filmed(data: Path, clip: str) -> tuple[np.ndarray, list[np.ndarray]]:
    """Middle lines ``[T, 2, S, 2]`` of a clip, and its worms' grey levels along and across.

    Grey levels are those of the frames before the two meet.
    """
    import cv2

    frames, lines = read_worms(data, clip, num_frames=None)
    before = slice(0, LEARNED_FRAMES, 2)
    found = []
    for worm in range(2):
        straightened = []
        for frame, pair in zip(frames[before], lines[before], strict=True):
            points, aside = _prolonged(pair[worm])
            places = points[:, None] + _ACROSS[:, None] * aside[:, None] - 0.5
            x, y = np.moveaxis(places.astype(np.float32), -1, 0)
            grey = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
            straightened.append(cv2.remap(grey, x, y, cv2.INTER_LINEAR))
        found.append(np.median(straightened, axis=0).astype(np.float32))
    return lines, found


def _drawn(line: np.ndarray, texture: np.ndarray) -> np.ndarray:
    """A picture ``[H, W]`` of one worm."""
    import cv2
    from scipy.spatial import KDTree

    points, aside = _prolonged(line)
    picture = np.full(_SIZE, _BEHIND, np.float32)
    low = np.maximum(points.min(axis=0) - _ASIDE - 2, 0).astype(int)
    high = np.minimum(points.max(axis=0) + _ASIDE + 2, _SIZE[::-1]).astype(int)
    rows, columns = np.mgrid[low[1] : high[1], low[0] : high[0]]
    places = np.stack([columns, rows], axis=-1) + 0.5
    distance, nearest = KDTree(points).query(places)
    across = ((places - points[nearest]) * aside[nearest]).sum(axis=-1)
    column = ((across - _ACROSS[0]) / 0.5).astype(np.float32)
    seen = cv2.remap(
        texture, column, nearest.astype(np.float32), cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    body = np.where(distance < _ASIDE - 0.5, np.minimum(seen, _BEHIND), _BEHIND).astype(np.float32)
    picture[low[1] : high[1], low[0] : high[0]] = cv2.GaussianBlur(body, (0, 0), 0.7)
    return picture


def _prolonged(line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points along a body and straight beyond its ends ``[K, 2]``, and the directions aside."""
    body = _along(line, _ALONG)
    ends = [body[0] - body[3], body[-1] - body[-4]]
    first, last = (end / np.linalg.norm(end) for end in ends)
    steps = np.arange(1.0, _BEYOND + 1)[:, None]
    points = np.concatenate([body[0] + steps[::-1] * first, body, body[-1] + steps * last])
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return points, np.stack([-along[:, 1], along[:, 0]], axis=1)


def _along(line: np.ndarray, count: int) -> np.ndarray:
    """So many points of a smooth curve through a line's, evenly apart."""
    from scipy.interpolate import CubicSpline

    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    places = np.concatenate([[0.0], np.cumsum(steps)])
    return CubicSpline(places, line)(np.linspace(0, places[-1], count))
