"""Comparisons at equal time: by hand, run by run."""

import json
import re

import numpy as np
import pytest
from made_results import PARAMETERS, batch, make, walks

from jaxpf.evaluation import Configuration
from jaxpf.evaluation.equal_time import curves
from jaxpf.evaluation.measures import by_name
from jaxpf.evaluation.output import charts
from jaxpf.evaluation.output.tables import write_tables
from jaxpf.evaluation.speed import NAME

#: Particles and frames per second: PS takes 10 and 40 ms, SPS 20 and 100.
TIMED = [
    ("PS", "21", 100, 100.0),
    ("PS", "21", 400, 25.0),
    ("SPS", "", 100, 50.0),
    ("SPS", "", 400, 10.0),
]


@pytest.fixture
def evaluated(tmp_path):
    truth, boxes = walks(seed=3, runs=6, frames=8, objects=2)
    rng = np.random.default_rng(4)
    configurations = [
        (
            Configuration(method, order, {**PARAMETERS, "particles": number}),
            [batch(truth + rng.normal(size=boxes.shape) * (0.2 + 40 / number))],
        )
        for method, order, number, _ in TIMED
    ]
    results = make(tmp_path / "results", configurations, truth)
    (results.folder / NAME).write_text(json.dumps([speed for *_, speed in TIMED]))
    return results


def test_the_first_method_is_read_off_between_its_numbers_of_particles(evaluated):
    tables = write_tables(evaluated)
    slow, fast, compared, _ = tables.summaries
    # No number of PS takes 100 ms, and PS is not compared with itself.
    assert [s.at_equal_time is not None for s in tables.summaries] == [False, False, True, False]
    found = compared.at_equal_time
    assert found.seconds == 1 / 50
    assert found.references == (0, 1)
    # 20 ms lie halfway between 10 and 40 by their logarithms.
    for name in ("success_area", "centre_error"):
        value = [summary.estimates[name].value for summary in (slow, fast, compared)]
        expected = value[2] - (value[0] + value[1]) / 2
        np.testing.assert_allclose(found.differences[name].value, expected, rtol=1e-5)
        assert (found.differences[name].standard_error > 0).all()
    written = (evaluated.folder / "summary.md").read_text()
    assert "| SPS, particles 100 | PS 21, particles 100 to 400 | 20 |" in re.sub(" +", " ", written)


def test_more_particles_never_take_less_time(evaluated):
    speeds = [25.0, 100.0, 50.0, 10.0]  # PS as if 400 particles were faster than 100
    (evaluated.folder / NAME).write_text(json.dumps(speeds))
    assert all(s.at_equal_time is None for s in write_tables(evaluated).summaries)


def test_curves_join_numbers_of_particles(evaluated):
    summaries = write_tables(evaluated).summaries
    lines = curves(summaries)
    assert list(lines) == ["PS 21", "SPS"]
    figure = charts.against_time(summaries, 2)
    for axis, measure in zip(figure.axes, ("success_area", "centre_error"), strict=True):
        assert by_name(measure).title in axis.get_ylabel()
        assert len(axis.containers) == 2
        line, *_ = axis.containers[0].lines
        np.testing.assert_allclose(np.asarray(line.get_xdata(), float), [10, 40])


def test_without_speeds_nothing_is_said(evaluated):
    (evaluated.folder / NAME).unlink()
    tables = write_tables(evaluated)
    assert "at equal time" not in (evaluated.folder / "summary.md").read_text().split("##")[-1]
    assert curves(tables.summaries) == {}
