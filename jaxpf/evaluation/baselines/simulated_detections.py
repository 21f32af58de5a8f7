"""Simulates a detector: true boxes with misses, false alarms and jitter.

Use it to run detection-based trackers on clips without detections.  Errors are independent between
frames and objects, unlike those of a real detector, so do not compare the scores with published
ones.
"""

import numpy as np
from numpy.typing import ArrayLike


def simulated_detections(
    truth: ArrayLike,
    frame_shape: tuple[int, ...],
    *,
    misses: float = 0.2,
    false_alarms: float = 0.5,
    jitter: float = 0.05,
    seed: int = 0,
) -> list[np.ndarray]:
    """Simulate the detections in every frame.

    Args:
        truth: boxes ``[T, P, 4]``, x, y, w, h in pixels; NaN where an object is absent.
        frame_shape: height and width of the frames.
        misses: probability that a present object is missed, equal for all objects.
        false_alarms: mean number of false boxes per frame (Poisson); each has the size of a random
            true box and a uniform position inside the frame.
        jitter: standard deviation of a detection's centre and sides, as a share of its width and
            height; the noise of the sides is lognormal.
        seed: of the random numbers.

    Returns:
        T arrays ``[M, 4]`` in random order; M varies.  Boxes outside the frame are dropped.
    """
    truth = np.asarray(truth, float)
    there = np.isfinite(truth).all(axis=-1)
    rng = np.random.default_rng(seed)
    sizes = truth[there][:, 2:]
    detections = []
    for boxes in (row[present] for row, present in zip(truth, there, strict=True)):
        seen = boxes[rng.random(len(boxes)) >= misses]
        size = seen[:, 2:] * np.exp(jitter * rng.standard_normal((len(seen), 2)))
        centre = seen[:, :2] + seen[:, 2:] / 2
        centre = centre + jitter * seen[:, 2:] * rng.standard_normal((len(seen), 2))
        false = sizes[rng.integers(len(sizes), size=rng.poisson(false_alarms))]
        room = np.maximum(np.array(frame_shape[1::-1]) - false, 0)
        every = np.concatenate(
            [
                np.hstack([centre - size / 2, size]),
                np.hstack([rng.random(false.shape) * room, false]),
            ]
        )
        every = rng.permutation(every)
        inside = (every[:, :2] < frame_shape[1::-1]) & (every[:, :2] + every[:, 2:] > 0)
        detections.append(every[inside.all(axis=1)])
    return detections
