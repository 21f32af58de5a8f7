"""Times of frames from time stamps as films have them."""

import numpy as np
import pytest
from films import moving_square, write_film

from jaxpf.media import open_frames
from jaxpf.media.film import Clock

P = 0.04
WRAP = 2**33 / 90_000


def times_of(stamps, rate=25):
    clock = Clock(rate)
    for stamp in stamps:
        clock.add(stamp)
    return [clock[number] for number in range(len(clock))], clock.rate


@pytest.mark.parametrize(
    ("stamps", "times"),
    [
        ([3, 3 + P, 3 + 2 * P], [0, P, 2 * P]),
        ([None] * 3, [0, P, 2 * P]),
        ([0, P, None, 3 * P], [0, P, 2 * P, 3 * P]),
        ([0, P, P, 3 * P], [0, P, 2 * P, 3 * P]),  # repeated
        ([0, P, 2 * P, 4 * P, 3 * P, 5 * P], [0, P, 2 * P, 4 * P, 5 * P, 6 * P]),  # out of order
        ([0, P, 60, 60 + P], [0, P, 60, 60 + P]),  # a pause
        ([1, 1 + P, 1 + 2 * P, 1 + 3 * P, 0, P], np.arange(6) * P),  # joined
        ([WRAP - P, WRAP, P, 2 * P, 5 * P], np.array([0, 1, 2, 3, 6]) * P),  # a counter that wraps
    ],
)
def test_times_grow_whatever_the_stamps(stamps, times):
    np.testing.assert_allclose(times_of(stamps)[0], times, atol=1e-6)


def test_the_rate_is_that_between_pauses():
    stamps = np.arange(100) / 30
    stamps[50:] += 60
    assert times_of(stamps, rate=1000)[1] == pytest.approx(30)
    assert times_of(np.round(stamps, 3), rate=1000)[1] == pytest.approx(30, rel=1e-3)
    assert times_of([5.0], rate=30)[1] == 30


def test_the_clock_rate_of_a_browser_is_no_frame_rate(tmp_path):
    """Its header gives 1000 frames a second."""
    frames, stamps = [moving_square(number) for number in range(8)], range(0, 8 * 33, 33)
    container_options = {"live": "1"}
    path = write_film(
        tmp_path / "recorded.webm",
        frames,
        "libvpx",
        rate=1000,
        stamps=stamps,
        container_options=container_options,
    )
    source = open_frames(path)
    assert source.fps == pytest.approx(1000 / 33)
    next(source.frames(5))
    assert source.shown_at(5) == pytest.approx(5 * 0.033)


@pytest.mark.parametrize("hours", [0, 1, WRAP / 3600 - 0.0004])
def test_times_of_films_joined_one_after_the_other_go_on(tmp_path, hours):
    """The first film begins late; its counter of 33 bits may wrap at the end."""

    frames = [moving_square(number) for number in range(6)]
    one = write_film(tmp_path / "one.ts", frames).read_bytes()
    first = write_film(
        tmp_path / "first.ts",
        frames,
        container_options={"output_ts_offset": f"{hours * 3600}"},
    ).read_bytes()
    (tmp_path / "both.ts").write_bytes(first + one)
    source = open_frames(tmp_path / "both.ts")
    shown = [source.shown_at(number) for number, _ in enumerate(source)]
    np.testing.assert_allclose(shown, np.arange(12) * P, atol=1e-4)
    assert source.note is None
