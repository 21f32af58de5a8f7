"""Curves over measured times."""

import numpy as np
import pytest
from made_results import PARAMETERS, batch, make, walks

from jaxpf.evaluation import figures
from jaxpf.evaluation.measures import by_name
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.summaries import measure_results

#: Particles and frames per second: PS takes 10 and 40 ms, SPS 20 and 100.
TIMED = [
    ("PS", "21", 100, 100.0),
    ("PS", "21", 400, 25.0),
    ("SPS", "", 100, 50.0),
    ("SPS", "", 400, 10.0),
]


pytestmark = pytest.mark.usefixtures("without_scores")


def test_curves_join_numbers_of_particles(tmp_path):
    truth, boxes = walks(seed=3, runs=6, frames=8, objects=2)
    rng = np.random.default_rng(4)
    configurations = [
        (
            Configuration(method, order, {**PARAMETERS, "num_particles": number}),
            [batch(truth + rng.normal(size=boxes.shape) * (0.2 + 40 / number))],
        )
        for method, order, number, _ in TIMED
    ]
    results = make(tmp_path / "results", configurations, truth)
    overview = measure_results(results)
    assert figures.lines_over_particles(overview) == {}  # nothing is timed
    results.write_speeds([speed for *_, speed in TIMED])
    lines = figures.lines_over_particles(overview)
    assert list(lines) == ["PS 21", "SPS"]
    figure = figures.against_time(overview, lines)
    for axis, measure in zip(figure.axes, ("success_auc", "centre_error"), strict=True):
        assert by_name(measure).title in axis.get_ylabel()
        assert len(axis.containers) == 2
        line, *_ = axis.containers[0].lines
        np.testing.assert_allclose(np.asarray(line.get_xdata(), float), [10, 40])
