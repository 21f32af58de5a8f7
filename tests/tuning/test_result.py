"""Intervals of tuned values."""

import numpy as np
import pytest

from jaxpf.tuning.parameters import Parameter
from jaxpf.tuning.result import Descent, Result


@pytest.mark.parametrize(
    ("repeats", "spread", "curvature", "reach"),
    [
        # Student's t of 2 degrees of freedom: 4.303; of none that count, the normal 1.960.
        (3, 1.0, np.nan, 4.303),
        (1, np.nan, 1.0, 1.960),
        (3, 1e-6, 1.0, 1.960),
        # Welch and Satterthwaite: 2 (1 + 1)^2 = 8 degrees of freedom: 2.306 times the root of 2.
        (3, 1.0, 1.0, 2.306 * 2**0.5),
        (2, 1.0, np.nan, np.nan),
    ],
)
def test_intervals_are_students(repeats, spread, curvature, reach):
    descent = Descent(0, {}, np.zeros(1), np.zeros(1), [], "settled")
    result = Result(
        parameters=(Parameter("x"),),
        start={"x": np.zeros(1)},
        free={"x": np.ones(1)},
        spread_errors={"x": np.array([spread])},
        curvature_errors={"x": np.array([curvature])},
        descents=[descent] * repeats,
    )
    low, high = result.intervals()["x"]
    assert (1 - low, high - 1) == pytest.approx((reach, reach), abs=1e-3, nan_ok=True)
    assert "nan" not in repr(result)
