"""Measures an evaluation: summaries of all configurations, remarks, and the conclusion."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jaxpf import filters
from jaxpf.evaluation.measuring.collection import (
    SCORED_RUNS,
    Summary,
    collect,
    configuration_name,
    has_scores,
)
from jaxpf.evaluation.measuring.conclusion import conclude
from jaxpf.evaluation.measuring.summary import summarise
from jaxpf.evaluation.work.results import BUILT_IN, Results

if TYPE_CHECKING:
    import pandas as pd

#: Remark for scenes with a single object.
ONE_OBJECT = (
    "One object: there is nothing to order, so all orderings coincide (SIR, PS, DPS, SPS) and one "
    "is run unless methods are named."
)


@dataclasses.dataclass(frozen=True)
class Overview:
    """What the finished runs of an evaluation show.

    Attributes:
        summaries: of every configuration with finished runs.
        remarks: sentences about missing results and caveats.
        conclusion: sentence on which configuration is best.
        ranking: indices of the summaries that have a value, best first.
        tables: pandas data frames by name, once they are written; see ``output.tables``.
    """

    summaries: list[Summary]
    remarks: list[str]
    conclusion: str
    ranking: list[int]
    tables: "dict[str, pd.DataFrame]" = dataclasses.field(default_factory=dict)

    @property
    def ranked(self) -> list[Summary]:
        """The summaries, the best configuration first and those without a value last."""
        rest = [index for index in range(len(self.summaries)) if index not in self.ranking]
        return [self.summaries[index] for index in [*self.ranking, *rest]]


def measure_results(results: Results) -> Overview:
    """Measure the finished runs of an evaluation, finished or not.

    Raises:
        InputError: a batch is damaged.
    """
    every = (collect(results, configuration) for configuration in results.configurations)
    summaries = [summary for summary in every if summary is not None]
    summarise(results, summaries)
    overview = Overview(summaries, [*_remarks(results, summaries)], *conclude(results, summaries))
    confident = (s for s in overview.ranked if s.confidence.frames[-1])
    overview.remarks.extend(_reliability(summary) for summary in [*confident][:1])
    return overview


def _remarks(results: Results, summaries: Sequence[Summary]) -> Iterator[str]:
    finished = {summary.name: summary.runs for summary in summaries}
    configurations = results.configurations
    for configuration in configurations:
        name = configuration_name(results, configuration)
        runs = finished.get(name, 0)
        if configuration.is_imported:
            yield f"{name}: one track, the same for every seed; without intervals."
        elif runs < results.runs:
            yield f"{name}: {runs} of {results.runs} runs are finished."
    ours = [c for c in configurations if c.kind == BUILT_IN]
    ordered = any(filters.filter_of(c.method.lower()).by_default for c in ours)
    if len(results.object_ids) == 1 and ordered:
        yield ONE_OBJECT
    if not has_scores():
        yield "HOTA, MOTA and IDF1 are left out; pip install --no-deps trackeval adds them."
    elif any(summary.runs > SCORED_RUNS for summary in summaries):
        yield f"HOTA, MOTA and IDF1 are of the first {SCORED_RUNS} runs."


def _reliability(summary: Summary) -> str:
    """Reliability of confidence of one configuration in a sentence."""
    confidence = summary.confidence
    value, bins = confidence.shares().value, confidence.bins
    shares = [
        f"{place / bins:.1f} to {(place + 1) / bins:.1f}: {100 * value[place]:.0f}%"
        for place in range(bins)
        if np.isfinite(value[place])
    ]
    area = confidence.area()
    area_text = f"; area under the curve {100 * area:.0f}%" if np.isfinite(area) else ""
    return (
        f"Confidence of {summary.name} (boxes on their object): {', '.join(shares)}{area_text}; "
        f"off its object, and not reported lost: {100 * confidence.silent():.0f}% of all frames."
    )
