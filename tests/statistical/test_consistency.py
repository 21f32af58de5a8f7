"""Estimates converge to the exact answer at the rate 1/sqrt(N)."""

import numpy as np
import pytest
from exact import OBJECTS, objects, record_runs

from jaxpf import ordering

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

SIZES = (100, 400, 1600, 6400)
RUNS = 250


ORDERINGS = {
    "ps": ordering.ps([2, 0, 3, 1]),
    "dps": ordering.dps(4),
    "sps": ordering.sps(OBJECTS),
}


@pytest.fixture(scope="module", params=ORDERINGS)
def last_frames(request):
    """The exact answer, and means and second moments of the last frame, ``[R, P]`` at each N."""
    exact, found = objects(), []
    for size in SIZES:
        order = ORDERINGS[request.param]
        recorded = record_runs(exact, order, seed=7, runs=RUNS, batch=50, num_particles=size)
        found.append([np.asarray(part)[:, -1] for part in recorded[1:3]])
    return exact, found


def test_error_falls_with_the_root_of_the_number_of_particles(last_frames):
    exact, found = last_frames
    rmse = [np.sqrt(np.mean((mean - exact.mean[-1]) ** 2)) for mean, _ in found]
    slope = np.polyfit(np.log(SIZES), np.log(rmse), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.1)


def test_many_particles_leave_no_visible_bias(last_frames):
    exact, found = last_frames
    mean, _ = found[-1]
    errors = mean - exact.mean[-1]
    assert (np.abs(errors.mean(0)) < 4 * errors.std(0) / RUNS**0.5).all()


def test_many_particles_have_the_posterior_variance(last_frames):
    exact, found = last_frames
    mean, second = found[-1]
    ratio = (second - mean**2).mean(0) / exact.variance[-1]
    np.testing.assert_allclose(ratio, 1.0, atol=0.03)
