"""Measures of the runs of a method on one sequence, whose targets meet or pass."""

import numpy as np

from jaxpf.papers.maccormick1999.scenes import FIRST_FRAMES, Case
from jaxpf.papers.maccormick1999.tracking import Outcome

#: Labels are judged where more than this share of the farther target is hidden.
MUCH_HIDDEN = 0.2
#: Number of frames just before an occlusion, and frames after it, for comparing spreads.
_BEFORE, _AFTER = 5, slice(5, 10)


def measures(case: Case, outcome: Outcome) -> dict[str, float]:
    """Shares of the runs, effective sample size, and of opaque targets labels and spreads.

    ``widening`` is the farther contour's spread at the height of the occlusion over that before,
    ``narrowing`` its spread some frames after the occlusion over that at the height.  Only runs
    that keep both targets count, because the spread of a lost target means something else; NaN if
    no run does.
    """
    values = {
        "kept": np.mean(outcome.kept),
        "coalesced": np.mean(outcome.coalesced),
        "exchanged": np.mean(outcome.swapped),
        "ess": np.mean(outcome.ess[:, :FIRST_FRAMES]),
    }
    if case.hidden is not None:
        before, hidden, after = _spreads(case, outcome)
        values["label right"] = label_right(case, outcome)
        values |= {"widening": hidden / before, "narrowing": after / hidden}
    return values


def label_right(case: Case, outcome: Outcome) -> float:
    """Share of frames with strong overlap whose more likely label is right."""
    of_front = outcome.in_front if case.farther == 1 else 1 - outcome.in_front
    of_front = of_front[:, case.hidden > MUCH_HIDDEN]
    return float(np.mean(np.where(np.isnan(of_front), np.nan, of_front > 0.5)))


def _spreads(case: Case, outcome: Outcome) -> tuple[float, float, float]:
    """Of the farther contour: before the occlusion, at its height, and some frames after it."""
    spread = outcome.spread[outcome.kept][:, :, case.farther]  # [kept, T]
    if not len(spread):
        return np.nan, np.nan, np.nan
    spread, hidden = spread.mean(axis=0), case.hidden
    covered = np.flatnonzero(hidden > 0)
    first, after = max(covered[0], 1), spread[covered[-1] + 1 :][_AFTER]
    before = spread[max(first - _BEFORE, 0) : first].mean()
    height = spread[hidden > 0.5 * hidden.max()].mean()
    return before, height, after.mean() if len(after) else np.nan
