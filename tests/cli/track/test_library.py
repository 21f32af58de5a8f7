"""``jaxpf track`` against the library: the same choices, and no frame is kept."""

import weakref

import jax
from small_video import HEIGHT, LENGTH, WIDTH, picture, true_boxes

from jaxpf.models import likelihoods
from jaxpf.streaming import stream
from jaxpf.targets import boxes as box_trackers

# Agreement with the library, and memory


def test_the_command_names_the_choices_that_the_library_has():
    from jaxpf.cli import track as module
    from jaxpf.filters import resampling
    from jaxpf.filters.partitioned import ordering
    from jaxpf.targets import boxes

    assert set(module._METHODS) == set(boxes.METHODS)
    assert set(module._SCHEMES) == set(resampling.SCHEMES)
    assert set(module._SWAPS) == set(ordering.SWAPS)


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
    tracker = box_trackers.box_tracker(
        likelihoods.histogram(picture(0), start, num_particles=60),
        start,
        box_trackers.ordering_of("dps", 2),
        num_particles=60,
    )
    for tracked in stream(tracker, jax.random.key(0), frames()):
        assert tracked.frame.shape == (HEIGHT, WIDTH, 3)
    assert most <= 3
