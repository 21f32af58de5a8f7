"""``jaxpf track`` against the library: no frame is kept."""

import weakref

import jax
from small_video import HEIGHT, LENGTH, WIDTH, picture, true_boxes

import jaxpf
from jaxpf import stream


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
    tracker = jaxpf.boxes.tracker(picture(0), start, appearance="colour", num_particles=60)
    for tracked in stream(tracker, jax.random.key(0), frames()):
        assert tracked.frame.shape == (HEIGHT, WIDTH, 3)
    assert most <= 3
