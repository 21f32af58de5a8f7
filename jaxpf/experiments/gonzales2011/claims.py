"""What the paper concludes from figures 8 to 11 and table 1, judged by our runs.

Every claim on the figures is judged under both dynamics, with the paper's swap and with the
unbiased one.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from jaxpf.experiments.claims import Claim, exact, judged
from jaxpf.experiments.estimates import mean_of
from jaxpf.experiments.gonzales2011.measure import Found
from jaxpf.experiments.gonzales2011.published import (
    FIGURE_8_PARTS,
    FIGURE_9_PARTICLES,
    FIGURE_10_PARTICLES,
    FIGURE_11_PARTICLES,
    FIGURE_11_PARTS,
    TABLE_1,
)
from jaxpf.experiments.gonzales2011.scenes import DYNAMICS, Outcomes
from jaxpf.experiments.gonzales2011.tables import gain
from jaxpf.experiments.gonzales2011.times import AT_MOST, METHODS, Times
from jaxpf.filters.partitioned.ordering import named
from jaxpf.measures import metrics

_SWAPS = ("SPS sorted", "SPS combinatorial")
#: Per cent of PS's error or variance within which a method counts as equal.
MARGIN = 3.0
#: "Twice more": a ratio between these.
_TWICE = 1.5, 2.5

Cell = tuple[str, int, int]


def claims(found: Found) -> list[Claim]:
    """All claims with their verdicts; those of which no cell was run are left out."""
    return [*curve_claims(found.outcomes), *time_claims(found.times)]


def curve_claims(outcomes: Outcomes) -> list[Claim]:
    """Those about figures 8 to 11."""
    found = []
    for dynamics in DYNAMICS:
        for method in _SWAPS:
            found += list(_of_variant(outcomes, dynamics, method))
    return [*found, _resamplings()]


def _of_variant(outcomes: Outcomes, dynamics: str, method: str) -> Iterator[Claim]:
    smooth = [cell for cell in outcomes if cell[0] == "smooth"]
    erratic = [("erratic", FIGURE_11_PARTS, FIGURE_11_PARTICLES)]
    ten = [("smooth", num_parts, FIGURE_9_PARTICLES) for num_parts in FIGURE_8_PARTS]
    strong = [cell for cell in outcomes if cell[0] == "strong_start"]
    stated: list[tuple[str, str, Sequence[Cell], str]] = [
        *(
            (
                f"SPS follows {num_parts} parts more closely than PS at every N",
                f"figure 8 ({letter})",
                [cell for cell in smooth if cell[1] == num_parts],
                "error",
            )
            for num_parts, letter in zip(FIGURE_8_PARTS, "ab", strict=True)
        ),
        (
            f"The variance of the particle set is lower, N = {FIGURE_9_PARTICLES}",
            "figure 9",
            ten,
            "variance",
        ),
        (
            f"A strong start disturbs SPS less, N = {FIGURE_10_PARTICLES}",
            "figure 10",
            strong,
            "error",
        ),
        ("Erratic motion disturbs SPS less", "figure 11", erratic, "error"),
        ("and its variance is lower", "figure 11", erratic, "variance"),
    ]
    for statement, figure, cells, measure in stated:
        chosen = [cell for cell in cells if cell in outcomes]
        if chosen:
            yield judged(
                f"{statement} [{method}, {dynamics}; % less than PS]",
                f"4, {figure}",
                "a curve below PS's",
                *(
                    mean_of(
                        gain(getattr(outcomes[cell], measure), dynamics, method),
                        _name(cell, chosen),
                        at_least=0,
                        margin=MARGIN,
                    )
                    for cell in chosen
                ),
                digits=1,
            )


def _name(cell: Cell, cells: Sequence[Cell]) -> str:
    """What tells a cell from the claim's others."""
    if len({other[2] for other in cells}) > 1:
        return f"N = {cell[2]}"
    return f"{cell[1]} parts"


def _resamplings() -> Claim:
    """Exact: no runs are needed."""
    parts = []
    for num_parts in FIGURE_8_PARTS:
        tree = [-1 if part == 0 else max(part - 2, 0) for part in range(num_parts)]
        ps, sps = (
            int(metrics.resamplings_per_frame(named(method, tree).resample_after))
            for method in ("ps", "sps")
        )
        what = f"{num_parts} parts, {ps} / {sps}"
        parts.append(exact(ps / sps, what, at_least=_TWICE[0], at_most=_TWICE[1]))
    return judged(
        "PS resamples about twice as often in a frame as SPS (1.5 to 2.5 times)",
        "4, on figure 9",
        "twice more",
        *parts,
        digits=2,
    )


def time_claims(times: Times) -> list[Claim]:
    """What the paper concludes from table 1."""
    slower = [
        100 * (other / one - 1)
        for rows in TABLE_1.values()
        for one, other in zip(rows["PS"], rows["SPS"], strict=True)
    ]
    limit = 100 * (AT_MOST - 1)
    within = sum(excess <= limit for excess in slower)
    found = []
    for method in METHODS[1:]:
        # The cells are the units: each has its own compiled kernel and its own overhead.
        excess = [100 * (np.median(cell[method] / cell["PS"]) - 1) for cell in times.values()]
        found.append(
            judged(
                f"SPS is usually not more than 4 % slower than PS [{method}]",
                "4, table 1",
                f"{np.mean(slower):.1f} % on average, <= 4 % in {within} of {len(slower)} cells",
                mean_of(excess, "% slower, mean of the cells", at_most=limit),
                digits=1,
                unit="cells",
            )
        )
    return found
