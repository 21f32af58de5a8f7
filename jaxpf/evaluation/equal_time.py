"""Orders configurations by their time per frame, for comparisons at equal time.

This needs several numbers of particles and measured speeds (``--speed``).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.summary import Summary

_PARTICLES = "particles"


def curves(summaries: Sequence[Summary]) -> dict[str, list[Summary]]:
    """Group configurations that differ only in the number of particles; keyed by name.

    Each group is sorted by that number and has at least two entries.  Configurations without a
    measured speed are left out.
    """
    lines: dict[Any, list[Summary]] = {}
    for summary in summaries:
        if _PARTICLES in summary.configuration.parameters and np.isfinite(
            summary.frames_per_second
        ):
            lines.setdefault(_kind(summary.configuration), []).append(summary)
    ordered = [sorted(line, key=_number) for line in lines.values() if len(line) > 1]
    return {line[0].name.replace(f", particles {_number(line[0])}", ""): line for line in ordered}


def times_of(speeds: Sequence[float]) -> np.ndarray:
    """Seconds per frame from frames per second, in ascending order of particles.

    The running maximum removes timing noise: more particles cannot take less time.
    """
    return np.maximum.accumulate([1 / speed for speed in speeds] or [0.0])


def _number(summary: Summary) -> Any:
    return summary.configuration.parameters[_PARTICLES]


def _kind(configuration: Configuration) -> tuple[str, str, tuple]:
    """Method, ordering, and all parameters except the number of particles."""
    others = {n: v for n, v in configuration.parameters.items() if n != _PARTICLES}
    return configuration.method, configuration.ordering, tuple(sorted(others.items(), key=str))
