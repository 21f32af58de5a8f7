"""States the conclusion of an evaluation: the best configuration, in one sentence.

Configurations are compared by their success AUC over all objects, paired by run.  Methods are
compared at equal settings, those of the best configuration; settings are compared only if there is
a single method.  Naming the best of C configurations involves C (C - 1) / 2 differences, so
intervals are Bonferroni-corrected for that number: together they hold with 95% confidence.  Fewer
than ten runs decide nothing: the sentence is a preview.
"""

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from jaxpf.evaluation.estimates import LEVEL, difference, with_all
from jaxpf.evaluation.measures import by_name
from jaxpf.evaluation.results import Configuration, Results
from jaxpf.evaluation.summaries import (
    ALL,
    Runs,
    Summary,
    common_runs,
    configuration_name,
    intervals,
    named_values,
)
from jaxpf.measures.intervals import DECISIVE

#: The measure that ranks configurations.
RANKED_BY = by_name("success_auc")
_MOST_NAMED = 3


def conclude(
    results: Results, summaries: Sequence[Summary], estimates: pd.DataFrame
) -> tuple[str, list[int]]:
    """State which configurations differ from the best, from the table ``estimates_of`` them.

    Returns:
        The sentence, and the indices of the summaries that have a value, best first.
    """
    areas = intervals(estimates, RANKED_BY.name, ALL, range(len(summaries)))[:, 0]
    ranking = [index for index in np.argsort(areas)[::-1].tolist() if np.isfinite(areas[index])]
    if not ranking:
        return "No run is finished, so there is nothing to conclude.", []
    best, *others = ranking
    ours = summaries[best].configuration
    held = [name for name in results.swept if name in ours.parameters]
    equal = [other for other in others if _agree(ours, summaries[other].configuration, held)]
    others, held = (equal, held) if equal else (others, [])
    names = [configuration_name(results, each.configuration, held) for each in summaries]
    settings = ", ".join(named_values(ours, held))
    start = f"With {settings}, where the mean is highest, " if held else ""
    if not others:
        return f"{names[best]}: success AUC {_share(areas[best])}.", ranking
    fewest = min((s.runs for s in summaries if not s.configuration.is_imported), default=DECISIVE)
    if fewest < DECISIVE:
        runs = "one run" if fewest == 1 else f"{fewest} runs"
        return (
            f"Preview of {runs}: {start[:1].lower() + start[1:]}{names[best]} is ahead, success "
            f"AUC {_share(areas[best])}; fewer than {DECISIVE} runs decide nothing.",
            ranking,
        )
    pairs = len(list(itertools.combinations(ranking, 2)))
    apart = {other: _difference(summaries[best], summaries[other], pairs) for other in others}
    worse = [other for other in others if apart[other][1] > 0]
    tied = [other for other in others if other not in worse]
    if not worse:
        return (
            f"{start}{'no' if start else 'No'} configuration tracks best: {names[best]} is "
            f"ahead, but {_listed(names, tied)} cannot be distinguished from it.",
            ranking,
        )
    # Report the gain over the first distinguishable configuration: the reference comes first.
    reference = min(worse)
    value, lower, upper = apart[reference]
    digits = 2 if upper - lower >= 0.02 else 3
    sentence = (
        f"{start}{names[best]} tracks best: success AUC {_share(value, digits, '+')} "
        f"[{_share(lower, digits)}, {_share(upper, digits)}] over {names[reference]}"
    )
    if tied:
        sentence += f"; {_listed(names, tied)} cannot be distinguished from it"
    elif len(worse) > 1:
        rest = [index for index in worse if index != reference]
        few = len(rest) <= _MOST_NAMED
        sentence += f", and better than {_listed(names, rest) if few else 'all others'}"
    return f"{sentence}.", ranking


def _agree(ours: Configuration, other: Configuration, names: Sequence[str]) -> bool:
    """Whether another configuration has the same values of named parameters, where it has them."""
    mine, theirs = ours.parameters, other.parameters
    return all(theirs.get(name, mine[name]) == mine[name] for name in names)


def _difference(first: Summary, second: Summary, pairs: int) -> tuple[float, float, float]:
    """First minus second, with the ends of an interval Bonferroni-corrected for ``pairs``."""
    ours, theirs = (each.of(RANKED_BY) for each in (first, second))
    if first.configuration.is_imported and second.configuration.is_imported:
        ends = [with_all(*each[1:])[0].item(-1) for each in (ours, theirs)]
        return (ends[0] - ends[1],) * 3
    # Imported tracks are the same for every seed, so repeat them for each run.
    if first.configuration.is_imported:
        ours = _repeated(ours, theirs.runs)
    if second.configuration.is_imported:
        theirs = _repeated(theirs, ours.runs)
    ours, theirs = common_runs(ours, theirs)
    level = 1 - (1 - LEVEL) / pairs
    found = difference(ours[1:], theirs[1:], RANKED_BY.bounds, level=level)
    value, lower, upper = (float(x[-1]) for x in (found.value, found.lower, found.upper))
    known = np.isfinite(lower)
    return value, lower if known else -np.inf, upper if known else np.inf


def _repeated(track: Runs, runs: np.ndarray) -> Runs:
    values, weights = (np.repeat(x[:1], len(runs), axis=0) for x in (track.values, track.weights))
    return Runs(runs, values, weights)


def _listed(all_names: Sequence[str], indices: Sequence[int]) -> str:
    names = [all_names[index] for index in indices[:_MOST_NAMED]]
    if len(indices) > _MOST_NAMED:
        names.append(f"{len(indices) - _MOST_NAMED} more")
    separator = "; " if any("," in name for name in names) else ", "
    *head, last = names
    return f"{separator.join(head)} and {last}" if head else last


def _share(value: float, digits: int = 2, sign: str = "") -> str:
    """Format a share without its leading zero, such as ".06"; adding 0 turns -0 into 0."""
    return f"{round(value, digits) + 0:{sign}.{digits}f}".replace("0.", ".", 1)
