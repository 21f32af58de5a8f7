"""What was measured: one tidy table, from which tables, claims and figures are made."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import pandas as pd

from jaxpf.papers.judging.estimates import ALONE, COMPARED, Quantity


class Study(NamedTuple):
    """The measurements of a paper.

    Attributes:
        rows: a row for each ``measure``, ``variant``, ``case`` (such as a sharpness) and ``scene``,
            with its ``value``; shares are between 0 and 1.
        shown: what the figures show beside.
        words: what the texts of tables quote.
    """

    rows: pd.DataFrame
    shown: Any = None
    words: Mapping[str, str] = {}

    def values(self, measure: str, variant: str) -> dict[str, pd.Series]:
        """Case -> values by scene; empty if it was not measured."""
        chosen = self.rows[(self.rows["measure"] == measure) & (self.rows["variant"] == variant)]
        groups = chosen.groupby("case", sort=False)
        return {str(case): group.set_index("scene")["value"] for case, group in groups}

    def figures(self, kind: str, measure: str, variant: str, against: str = "") -> list[Quantity]:
        """Of each case, the estimate over scenes, or two variants' on their common scenes.

        Args:
            kind: ``"mean"``, ``"percent"`` of shares, or for positive values that are compared by
                the geometric mean of their ratios ``"ratio"`` (without another variant: to 1) or
                ``"gain"``, one less the ratio in per cent (without another variant: the mean).
            measure: name of the measure.
            variant: whose.
            against: the variant to compare with, or empty.

        Returns:
            An empty list if a variant was not measured.
        """
        first = self.values(measure, variant)
        if not against:
            return [ALONE[kind](values, case) for case, values in first.items()]
        second = self.values(measure, against)
        pairs = ((case, values.align(second[case], "inner")) for case, values in first.items())
        return [COMPARED[kind](*pair, case) for case, pair in pairs] if second else []

    def variants(self, measure: str) -> list[str]:
        """All variants of which a measure was taken."""
        return list(self.rows.loc[self.rows["measure"] == measure, "variant"].unique())


def tidy(values: Mapping[tuple[str, str, str], Any]) -> pd.DataFrame:
    """The ``rows`` of a study from ``[S]`` values for each measure, variant and case.

    Scenes are counted; a variant may have the first ones only.
    """
    rows = pd.DataFrame(list(values), columns=["measure", "variant", "case"])
    rows["value"] = list(values.values())
    rows = rows.explode("value")
    rows["scene"] = rows.groupby(level=0).cumcount()
    return rows.reset_index(drop=True).astype({"value": float})
