"""The measurements of ``jaxpf bench``, at small sizes: they run, and say what they should.

Nothing is asserted about time.  For figures, run ``jaxpf bench``.
"""

import importlib
from itertools import islice
from math import comb

import numpy as np
import pytest

from jaxpf.cli.benchmarks import (
    SECTIONS,
    appearance,
    generic,
    gradients,
    growth,
    histogram,
    labelled,
    memory,
    points,
    problems,
)
from jaxpf.cli.benchmarks.growth import Growth
from jaxpf.measures.timing import median_interval

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("compiled_quickly")]


def test_memory_does_not_grow_with_the_number_of_frames():
    sizes = dict(memory.of_runs(problems.line_tracker(10_000), 1, (10, 1000)))
    # What grows is what the record keeps of a frame (4 bytes), not a copy of the particles.
    assert (sizes[1000] - sizes[10]) / 990 < 100


def test_the_generic_kernel_is_timed_against_the_minimal_filter():
    rows = list(generic.rows(repeats=1, num_particles=20, num_frames=3))
    assert all(row.ratio > 0 for row in rows)
    assert rows[0].ratio == 1


def test_the_histogram_is_timed_against_opencv(monkeypatch):
    monkeypatch.setattr(histogram, "RUNS", 2)
    monkeypatch.setattr(histogram, "PARTICLES", 20)
    rows = list(histogram.rows(repeats=1))
    assert [row.what for row in rows[1:]] == ["histogram, integral", "histogram, sampled"]
    assert all(np.isfinite([row.nanoseconds, row.ratio]).all() for row in rows)


def test_learned_appearance_is_timed_against_colour():
    rows = list(appearance.rows(repeats=1, num_runs=1, num_particles=20, num_frames=2))
    assert [row.of for row in rows] == ["", "this / colour"] * 2
    assert all(np.isfinite([row.nanoseconds, row.ratio]).all() for row in rows)


def test_growth_is_timed_and_drawn():
    few, many = islice(growth.growth(largest=1000, repeats=1), 2)
    assert (few[:3], many[:3]) == ((100, 1, 1), (1000, 1, 1))
    assert few.nanoseconds > 0
    assert many.nanoseconds > 0
    others = [Growth(1000, 2, 1, 30.0), Growth(1000, 4, 1, 31.0), Growth(1000, 1, 10, 32.0)]
    lines = [axis.lines[0].get_xydata() for axis in growth.growth_figure([few, many, *others]).axes]
    assert [line[:, 0].tolist() for line in lines] == [[100, 1000], [1, 2, 4], [1, 10]]
    assert lines[2][1, 1] == 32


def test_the_gradient_is_timed_against_the_value():
    rows = list(gradients.rows(repeats=1, num_particles=30, num_frames=6, num_runs=2))
    assert [row.goal for row in rows] == ["", "<= 4"] * 3
    assert [row.ratio for row in rows[::2]] == [1, 1, 1]
    assert all(np.isfinite([row.nanoseconds, row.ratio]).all() for row in rows)


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


def test_labelled_particles_are_timed_against_one_partition():
    rows = list(labelled.rows(repeats=1, num_particles=70, num_runs=2, num_frames=2))
    assert [row.goal for row in rows] == ["", "<= 1.5", "<= 1.5"]
    assert rows[0].ratio == 1
    (one, few), (other, many) = growth.of_targets((1, 6), per_target=20, repeats=1)
    assert (one, other) == (1, 6)
    assert few > 0
    assert many > 0


def test_memory_of_labelled_particles_does_not_grow_with_the_number_of_frames():
    sizes = dict(memory.of_runs(problems.labelled_line_tracker(10, 10_000), 10, (10, 1000)))
    assert (sizes[1000] - sizes[10]) / 990 < 100


def test_points_are_timed():
    found = list(points.rows(repeats=1, height=240, width=320))
    assert len(found) == 5
    assert all(row.nanoseconds > 0 for row in found)


def test_every_section_has_a_title():
    for name in SECTIONS:
        section = importlib.import_module(f"jaxpf.cli.benchmarks.{name}")
        assert section.TITLE
        assert callable(section.rows)
