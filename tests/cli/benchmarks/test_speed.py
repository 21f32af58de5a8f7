"""The measurements of ``jaxpf bench``, at small sizes: they run, and say what they should.

Nothing is asserted about time.  For figures, run ``jaxpf bench``.
"""

from functools import partial

import numpy as np
import pytest

from jaxpf.cli.benchmarks import measurements
from jaxpf.measures.timing import interleaved

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("make", "sizes", "goals"),
    [
        (measurements.generic, (20, 3), ["", "<= 1.5", "<= 2"]),
        (measurements.kernel, (2,), ["", "", "", "<= 1.10", ">= 24"]),
        (measurements.frame_sizes, (((90, 120), (240, 320)), 2), ["", "<= 2"]),
    ],
)
def test_every_case_is_timed_against_its_baseline(make, sizes, goals):
    section = make(*sizes)
    assert [case.goal for case in section.cases] == goals
    names = {case.what for case in section.cases}
    measured = section.measure(repeats=1)
    for case, (nanoseconds, ratio) in zip(section.cases, measured, strict=True):
        assert nanoseconds > 0
        assert np.isfinite(ratio.value)
        assert case.baseline in names | {""}
        if case.baseline in ("", case.what):
            assert ratio[0] == 1


def test_a_ratio_is_of_one_unit(monkeypatch):
    cases = [
        measurements.Case("usual", lambda: None, 10),
        measurements.Case("this", lambda: None, 100, "usual"),
    ]
    clock = iter(np.cumsum([0, 1.0] * 20))
    timed = partial(interleaved, clock=lambda: float(next(clock)))
    monkeypatch.setattr(measurements, "interleaved", timed)
    measured = measurements.Section("", cases).measure(3)
    assert measured[1][0] == pytest.approx(1e7)
    assert measured[1][1][0] == pytest.approx(0.1)
