"""Pictures like those of a hand-held camera: people in a street, and a puppet before a wall.

For experiments; no paper has these scenes.  Three people walk and pass each other, or five people
cross the picture, entering and leaving.
"""

import dataclasses

import cv2
import numpy as np

from scenes import drawing as drawn
from scenes.articulated import Articulated
from scenes.deforming import Bend, Body, Film, Pose, Sketch, bumps, draw, noise
from scenes.drawn import streams
from scenes.scene import Scene

WIDTH, HEIGHT = 480, 270
#: Size of a person at scale 1, pixels.
SIZE = np.array([40.0, 90.0])
_PAVEMENT, _MARGIN, _PIXEL_NOISE = 150, 16, 3.0


def street_scene(num_frames: int = 90, seed: int = 0, *, come_and_go: bool = False) -> Scene:
    """People in a street.

    Args:
        num_frames: length of the sequence.
        seed: of appearance, steps and camera motion.
        come_and_go: five people cross the picture, instead of three who stay in it; the box of a
            person is NaN while the centre is outside the picture.
    """
    look, path, camera = streams(seed, 3)
    wall = _wall(look)
    scales, middles = _walks(num_frames, come_and_go)
    people = [_person(look) for _ in scales]
    phases = path.uniform(0, 2 * np.pi, len(people))
    sway = 2 * drawn.wandering(path, num_frames, 2, 60.0)
    middles = middles + sway[:, None]
    film = Film(camera, HEIGHT, WIDTH, _PIXEL_NOISE)
    far_to_near = np.argsort(scales)
    for t in range(num_frames):
        frame = _shifted(wall, sway[t])
        for person in far_to_near:
            (x, y), bend = middles[t, person], _step(0.3 * t + phases[person])
            pose = Pose(x, y, scales[person], bend=bend)
            draw(frame, people[person], pose)
        film.add(frame)
    sizes = np.tile(SIZE * scales[:, None], (num_frames, 1, 1))
    outside = (middles < 0).any(axis=-1) | (middles > [WIDTH, HEIGHT]).any(axis=-1)
    boxes = np.concatenate([middles - sizes / 2, sizes], axis=-1)
    boxes[outside] = np.nan
    return Scene(
        "street",
        np.stack(film.frames),
        boxes,
        [_seen(person, scale) for person, scale in zip(people, scales, strict=True)],
        25.0,
        {"num_frames": num_frames, "seed": seed, "come_and_go": come_and_go},
    )


def puppet_scene(num_frames: int = 60, seed: int = 0) -> Scene:
    """The seven parts of ``Articulated`` before the street's wall; same ``extras``."""
    parts = Articulated(
        num_frames=num_frames, frame_width=WIDTH, frame_height=HEIGHT, background_noise=0.0
    ).draw(seed)
    look, camera = (np.random.default_rng([seed, 10 + stream]) for stream in range(2))
    wall = _wall(look)[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN]
    film = Film(camera, HEIGHT, WIDTH, _PIXEL_NOISE)
    bodies = [
        Body(patch.astype(np.float32), np.ones(patch.shape[:2], np.float32))
        for patch in parts.patches
    ]
    for poses in parts.extras["poses"]:
        frame = wall.copy()
        # From the arms' ends to the centre, as in ``Articulated``.
        for body, (x, y, angle) in reversed(list(zip(bodies, poses, strict=True))):
            draw(frame, body, Pose(x, y, 1.0, angle))
        film.add(frame)
    return dataclasses.replace(parts, name="puppet", frames=np.stack(film.frames))


def _walks(num_frames: int, come_and_go: bool) -> tuple[np.ndarray, np.ndarray]:
    """Scales ``[P]``, and the people's centres ``[T, P, 2]`` for a static camera."""
    times = np.arange(num_frames)
    if not come_and_go:
        scales = np.array([1.0, 1.1, 0.8])
        first = np.array([[140.0, 125.0], [322.0, 127.5], [416.0, 120.0]])
        speeds = np.array([2.2, -2.0, -1.2])
        return scales, first + np.stack([times[:, None] * speeds, np.zeros((len(times), 3))], -1)
    scales = np.array([1.0, 1.15, 0.85, 1.05, 0.9])
    began, speeds = 14.0 * np.arange(5), np.array([5.0, -4.5, 4.0, -5.5, -4.0])
    from_side = np.where(speeds > 0, -40.0, WIDTH + 40.0)
    across = from_side + (times[:, None] - began) * speeds
    # Nearer people are larger and lower in the picture.
    down = np.broadcast_to(
        _PAVEMENT + 60 * (scales - 0.85) - SIZE[1] * scales / 2 + 12, across.shape
    )
    return scales, np.stack([across, down], axis=-1)


def _wall(rng: np.random.Generator) -> np.ndarray:
    """Bricks, windows and a pavement, float32, with a margin on each side of the picture."""
    height, width = HEIGHT + 2 * _MARGIN, WIDTH + 2 * _MARGIN
    shape = (height, width)
    wall = np.ascontiguousarray(
        noise(rng, shape, 70.0) * 8 + noise(rng, shape, 6.0) * 7 + np.array([150.0, 122.0, 104.0])
    ).astype(np.float32)
    for row, y in enumerate(range(0, height, 12)):
        cv2.line(wall, (0, y), (width, y), (176, 164, 150), 1)
        for x in range(12 * (row % 2), width, 24):
            cv2.line(wall, (x, y), (x, y + 12), (176, 164, 150), 1)
    for x in range(60, width, 130):
        cv2.rectangle(wall, (x, 26), (x + 46, 92), (206, 200, 190), -1)
        cv2.rectangle(wall, (x + 5, 31), (x + 41, 87), (70, 84, 98), -1)
    ground = noise(rng, shape, 9.0) * 5 + noise(rng, shape, 2.0) * 5 + np.array([118, 116, 114])
    wall[_PAVEMENT + _MARGIN :] = ground[_PAVEMENT + _MARGIN :]
    return wall


def _shifted(wall: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The camera's view of the wall, ``[H, W, 3]``, shifted by ``by`` pixels."""
    matrix = np.array([[1, 0, by[0] - _MARGIN], [0, 1, by[1] - _MARGIN]])
    return cv2.warpAffine(wall, matrix, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REPLICATE)


def _person(rng: np.random.Generator) -> Body:
    """A person of 40 x 90 pixels, in a shirt with individual markings."""
    shirt, trousers = rng.uniform(40, 230, 3), rng.uniform(20, 110, 3).tolist()
    sketch = Sketch(shirt + 26 * noise(rng, (104, 64), 5.0))
    skin, hair = (214, 168, 140), rng.uniform(20, 120, 3).tolist()
    for side in (-1, 1):
        sketch.limb((5 * side, 8), (7 * side, 40), 11, trousers, wider=1)
        sketch.limb((12 * side, -20), (15 * side, 2), 7)
        sketch.limb((15 * side, 2), (15 * side, 6), 6, skin, wider=1)
    sketch.limb((-4, -18), (-4, 4), 17)
    sketch.limb((4, -18), (4, 4), 17)
    head = (sketch.middle + np.array([0, -35])).tolist()
    cv2.circle(sketch.alpha, head, 9, 255, -1, cv2.LINE_AA)
    cv2.circle(sketch.picture, head, 10, skin, -1, cv2.LINE_AA)
    cv2.ellipse(sketch.picture, head, (10, 10), 0, 180, 360, hair, -1, cv2.LINE_AA)
    return sketch.body()


def _step(phase: float) -> Bend:
    """Swing the legs and hands in opposite phase."""
    reach = 6 * np.sin(phase)
    return bumps(
        ((-7, 42), 14.0, (reach, 0)),
        ((7, 42), 14.0, (-reach, 0)),
        ((-15, 6), 9.0, (-0.5 * reach, 0)),
        ((15, 6), 9.0, (0.5 * reach, 0)),
    )


def _seen(person: Body, scale: float) -> np.ndarray:
    """A person's reference patch, uint8, on grey ground."""
    width, height = np.rint(SIZE * scale).astype(int)
    frame = np.full((height, width, 3), 128, np.float32)
    draw(frame, person, Pose(width / 2, height / 2, scale))
    return np.clip(frame, 0, 255).astype(np.uint8)
