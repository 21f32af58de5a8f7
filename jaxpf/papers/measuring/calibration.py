"""The search for settings that a paper does not publish: one stage after the other.

Each stage tries a few changes of the best settings of the last, on scenes of seeds that no report
uses, and keeps those with the least score; where the values it began with are among the changes it
ends no worse than it began.  Stages may be judged by different scores.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from jaxpf.papers.judging.comparison_table import Table


class Trial(NamedTuple):
    """One setting and what it gave.

    Attributes:
        stage: what was varied.
        settings: all of them.
        figures: name -> text, to show.
        score: less is better.
    """

    stage: str
    settings: Mapping[str, Any]
    figures: Mapping[str, str]
    score: Any


def search(
    start: Mapping[str, Any],
    stages: Mapping[str, Iterable[Mapping[str, Any]]],
    measure: Callable[[str, Mapping[str, Any]], tuple[Mapping[str, str], Any]],
    report: Callable[[str], None],
) -> tuple[dict[str, Any], list[Trial]]:
    """Search through the stages.

    Args:
        start: settings by name.
        stages: name -> the changes that it tries.
        measure: (stage, settings) -> figures and score.
        report: takes a line for each trial.

    Returns:
        The best settings, and all trials in order.
    """
    best, trials = dict(start), []
    for stage, changes in stages.items():
        found = []
        for changed in changes:
            settings = {**best, **changed}
            trial = Trial(stage, settings, *measure(stage, settings))
            figures = ", ".join(f"{name} {text}" for name, text in trial.figures.items())
            report(f"{stage}: {_listed(changed)}: {figures}")
            found.append(trial)
        trials += found
        best = dict(min(found, key=lambda trial: trial.score).settings)
    return best, trials


def trial_table(trials: Sequence[Trial], best: Mapping[str, Any]) -> Table:
    """The search as a table, with what it chose."""
    return Table(
        "calibration",
        "Calibration, on its own seeds",
        ["stage", *trials[0].settings, *trials[0].figures],
        [
            (trial.stage, [*map(_text, trial.settings.values()), *trial.figures.values()])
            for trial in trials
        ],
        f"Best: {_listed(best)}.",
    )


def _listed(settings: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {_text(value)}" for name, value in settings.items())


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)
