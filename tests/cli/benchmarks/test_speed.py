"""The measurements of ``jaxpf bench``, at small sizes: they run, and say what they should.

Nothing is asserted about time.  For figures, run ``jaxpf bench``.
"""

from math import comb

import numpy as np
import pytest

from jaxpf.cli.benchmarks import measurements, memory, problems
from jaxpf.measures.timing import median_interval

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("compiled_quickly")]


def test_memory_does_not_grow_with_the_number_of_frames():
    sizes = dict(memory.of_runs(problems.line_tracker(10_000), 1, (10, 1000)))
    # What grows is what the record keeps of a frame (4 bytes), not a copy of the particles.
    assert (sizes[1000] - sizes[10]) / 990 < 100


@pytest.mark.parametrize(
    ("make", "sizes", "goals"),
    [
        (measurements.generic, (20, 3), ["", "<= 1.5", "<= 2"]),
        (measurements.histograms, (2, 20), ["", ">= 100", ""]),
        (measurements.appearance, (1, 20, 2), ["", "<= 2"] * 2),
        (measurements.frame_sizes, (((90, 120), (240, 320)), 2), ["", "<= 2"]),
        (measurements.gradients, (30, 6, 2), ["", "<= 4"] * 3),
        (measurements.labelled, (70, 2, 2), ["", "<= 1.5", "<= 1.5"]),
        (
            measurements.points,
            (240, 320, 2),
            ["<= 2800 ns", "3.3e6 ns or less", "3.3e6 ns or less", "6.7e6 ns or less"],
        ),
    ],
)
def test_every_case_is_timed_against_its_baseline(make, sizes, goals):
    section = make(*sizes)
    rows = list(section.rows(repeats=1))
    assert section.title
    assert [row.goal for row in rows] == goals
    names = {case.what for case in section.cases}
    for case, row in zip(section.cases, rows, strict=True):
        assert row.what == case.what
        assert row.nanoseconds > 0
        assert np.isfinite([row.ratio, row.low, row.high]).all()
        assert case.baseline in names | {""}
        if case.baseline in ("", case.what):
            assert row.ratio == 1


def test_a_ratio_is_of_one_unit_and_may_be_the_other_way_round():
    ways = []
    for inverse in (False, True):
        cases = [
            measurements.Case("usual", lambda: None, 10),
            measurements.Case("this", lambda: None, 100, "usual", "of", "", inverse),
        ]
        clock = iter(np.cumsum([0, 1.0] * 20))
        rows = measurements.Section("", cases, lambda clock=clock: float(next(clock))).rows(3)
        ways.append([row.ratio for row in rows][1])
    assert ways == pytest.approx([0.1, 10])


def test_windows_bound_the_memory_of_a_gradient():
    few, many = memory.FRAMES
    window = memory.WINDOW
    ((_, (window_few,)),) = memory.of_gradients(100, [few], [window])
    ((_, (whole, frame_by_frame, window_many)),) = memory.of_gradients(100, [many])
    assert many == 10 * few
    assert window_many < 0.5 * frame_by_frame < 0.5 * whole
    # Windows of k keep T / k sets of particles and k frames: less than 2.5 times as much.
    assert window_many < 2.5 * window_few


@pytest.mark.parametrize("repeats", [9, 15, 31])
def test_the_interval_of_the_median_covers_95_percent(repeats):
    median, low, high = median_interval(np.arange(float(repeats)))
    assert median == (repeats - 1) / 2
    assert high == repeats - 1 - low
    # The median lies outside if at most `low` values fall on one side of it.
    outside = 2 * sum(comb(repeats, k) for k in range(int(low) + 1)) / 2**repeats
    assert outside <= 0.05


def test_memory_of_labelled_particles_does_not_grow_with_the_number_of_frames():
    sizes = dict(memory.of_runs(problems.labelled_line_tracker(10, 10_000), 10, (10, 1000)))
    assert (sizes[1000] - sizes[10]) / 990 < 100
