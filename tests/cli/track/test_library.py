"""``jaxpf track`` against the library: no frame is kept."""

import weakref

import jax
from small_video import HEIGHT, LENGTH, WIDTH, picture, true_boxes

from jaxpf.filters.partitioned import ordering
from jaxpf.models import likelihoods
from jaxpf.streaming import stream
from jaxpf.targets.boxes import box_tracker


def test_frames_that_were_tracked_are_not_kept():
    references, most = [], 0

    def frames():
        nonlocal most
        for number in range(2 * LENGTH):
            frame = picture(number % LENGTH)
            references.append(weakref.ref(frame))
            most = max(most, sum(reference() is not None for reference in references))
            yield frame

    start = true_boxes(0)
    tracker = box_tracker(
        likelihoods.histogram(picture(0), start, num_particles=60),
        start,
        ordering.dps(2),
        num_particles=60,
    )
    for tracked in stream(tracker, jax.random.key(0), frames()):
        assert tracked.frame.shape == (HEIGHT, WIDTH, 3)
    assert most <= 3
