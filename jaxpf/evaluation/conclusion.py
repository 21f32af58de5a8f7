"""States the conclusion of an evaluation: the best configuration, in one sentence.

Configurations are compared by their success AUC over all objects, paired by run.  Methods are
compared at equal settings, those of the best configuration; settings are compared only if there is
a single method.  Naming the best of C configurations involves C (C - 1) / 2 differences, so
intervals are Bonferroni-corrected for that number: together they hold with 95% confidence.  Fewer
than ten runs decide nothing: the sentence is a preview.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from jaxpf.evaluation.estimates import ALL, LEVEL, difference
from jaxpf.evaluation.results import Configuration, Results
from jaxpf.measures.intervals import DECISIVE

#: The measure and the object that rank configurations.
RANKED_BY = "success_auc", ALL
_MOST_NAMED = 3


def areas_of(estimates: pd.DataFrame) -> pd.Series:
    """Success AUC of the configurations that have one, by their index, best first."""
    measure, of = RANKED_BY
    rows = estimates[(estimates.measure == measure) & (estimates.object == of)]
    areas = rows.set_index("configuration").value.astype(float)
    return areas.iloc[np.argsort(areas.to_numpy())[::-1]]


def conclude(results: Results, values: Mapping[int, pd.DataFrame], areas: pd.Series) -> str:
    """State which configurations differ from the best.

    Args:
        results: the evaluation.
        values: of every run of the configurations, by their index, as for ``difference``.
        areas: see ``areas_of``.
    """
    if not len(areas):
        return "No run is finished, so there is nothing to conclude."
    best, *others = areas.index.tolist()
    configurations = results.configurations
    ours = configurations[best]
    held = [name for name in results.swept if name in ours.parameters]
    equal = [other for other in others if _agree(ours, configurations[other], held)]
    others, held = (equal, held) if equal else (others, [])
    names = [results.name_of(each, held) for each in configurations]
    start = f"With {', '.join(ours.named(held))}, where the mean is highest, " if held else ""
    if not others:
        return f"{names[best]}: success AUC {_share(areas[best])}."
    imported = {index for index in values if configurations[index].is_imported}
    fewest = min((len(values[i]) for i in values if i not in imported), default=DECISIVE)
    if fewest < DECISIVE:
        runs = "one run" if fewest == 1 else f"{fewest} runs"
        return (
            f"Preview of {runs}: {start[:1].lower() + start[1:]}{names[best]} is ahead, success "
            f"AUC {_share(areas[best])}; fewer than {DECISIVE} runs decide nothing."
        )
    level = 1 - (1 - LEVEL) / math.comb(len(areas), 2)
    apart = {other: _difference(values, best, other, imported, level) for other in others}
    worse = [other for other in others if apart[other][1] > 0]
    tied = [other for other in others if other not in worse]
    if not worse:
        return (
            f"{start}{'no' if start else 'No'} configuration tracks best: {names[best]} is "
            f"ahead, but {_listed(names, tied)} cannot be distinguished from it."
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
    return f"{sentence}."


def _agree(ours: Configuration, other: Configuration, names: Sequence[str]) -> bool:
    """Whether another configuration has the same values of named parameters, where it has them."""
    mine, theirs = ours.parameters, other.parameters
    return all(theirs.get(name, mine[name]) == mine[name] for name in names)


def _difference(
    values: Mapping[int, pd.DataFrame], ours: int, theirs: int, imported: set[int], level: float
) -> tuple[float, float, float]:
    """One configuration minus another, with the ends of an interval; NaN with too few runs."""
    first, second = (values[index][[RANKED_BY]] for index in (ours, theirs))
    # An imported track is the same in every run.
    if ours in imported:
        first = first.reindex(second.index, method="ffill")
    if theirs in imported:
        second = second.reindex(first.index, method="ffill")
    found = difference(first, second, level).iloc[0]
    if {ours, theirs} <= imported:
        return found.value, found.value, found.value
    return found.value, found.lower, found.upper


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
