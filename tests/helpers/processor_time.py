"""Tells at the end of a run what processor time the tests took, and which took most of it.

Processor time, of the test's process and of the programs it started, compares between machines that
are busy with other work; the time by the clock does not.
"""

import os
from collections import Counter

import pytest

_SHOWN = 10
_last = [0.0]


def _now():
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def pytest_collection_finish():
    _last[0] = _now()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    report = yield
    report.processor_seconds = _now() - _last[0]  # pytest-xdist's workers send it along
    _last[0] = _now()
    return report


def pytest_terminal_summary(terminalreporter):
    seconds = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            seconds[getattr(report, "nodeid", "")] += getattr(report, "processor_seconds", 0)
    terminalreporter.section(f"{sum(seconds.values()):.0f} s of processor time")
    number = terminalreporter.config.option.durations or _SHOWN
    for name, value in seconds.most_common(number):
        terminalreporter.write_line(f"{value:8.1f} s {name}")
