"""What the paper concludes from figures 8 to 11, judged by our runs.

Every claim is judged under both dynamics, with the paper's swap and with the unbiased one.
"""

from collections.abc import Iterator, Sequence

from jaxpf.experiments.claims import Claim, Quantity, judged, student_interval
from jaxpf.experiments.gonzales2011.curves import Outcomes, gain, measured
from jaxpf.experiments.gonzales2011.published import (
    FIGURE_8_PARTS,
    FIGURE_9_PARTICLES,
    FIGURE_10_PARTICLES,
    FIGURE_11_PARTICLES,
    FIGURE_11_PARTS,
)
from jaxpf.experiments.gonzales2011.tracking import DYNAMICS
from jaxpf.filters.partitioned.ordering import named
from jaxpf.measures import metrics

_SWAPS = ("SPS sorted", "SPS combinatorial")

Cell = tuple[str, int, int]


def claims(outcomes: Outcomes) -> list[Claim]:
    """All claims with their verdicts; those of which no cell was run are left out."""
    found = []
    for dynamics in DYNAMICS:
        for method in _SWAPS:
            found += list(_of_variant(outcomes, dynamics, method))
    return [*found, _resamplings()]


def _of_variant(outcomes: Outcomes, dynamics: str, method: str) -> Iterator[Claim]:
    def claim(statement: str, source: str, cells: Sequence[Cell], measure: str) -> Iterator[Claim]:
        chosen = [cell for cell in cells if cell in outcomes]
        parts = [
            Quantity(
                _name(cell, chosen),
                measured(gain(getattr(outcomes[cell], measure), dynamics, method)).value,
                student_interval(gain(getattr(outcomes[cell], measure), dynamics, method)),
                at_least=0,
            )
            for cell in chosen
        ]
        if parts:
            yield judged(
                f"{statement} [{method}, {dynamics}; % less than PS]",
                source,
                "a curve below PS's",
                parts,
                digits=1,
            )

    for num_parts in FIGURE_8_PARTS:
        cells = [cell for cell in outcomes if cell[:2] == ("smooth", num_parts)]
        yield from claim(
            f"SPS follows {num_parts} parts more closely than PS at every N",
            f"4, figure 8 ({'a' if num_parts == 7 else 'b'})",
            cells,
            "error",
        )
    yield from claim(
        f"The variance of the particle set is lower, N = {FIGURE_9_PARTICLES}",
        "4, figure 9",
        [("smooth", num_parts, FIGURE_9_PARTICLES) for num_parts in FIGURE_8_PARTS],
        "variance",
    )
    yield from claim(
        f"A strong start disturbs SPS less, N = {FIGURE_10_PARTICLES}",
        "4, figure 10",
        [cell for cell in outcomes if cell[0] == "strong_start"],
        "error",
    )
    erratic = [("erratic", FIGURE_11_PARTS, FIGURE_11_PARTICLES)]
    yield from claim("Erratic motion disturbs SPS less", "4, figure 11", erratic, "error")
    yield from claim("and its variance is lower", "4, figure 11", erratic, "variance")


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
        ratio = ps / sps
        parts.append(
            Quantity(
                f"{num_parts} parts, {ps} / {sps}",
                ratio,
                lambda level, ratio=ratio: (ratio, ratio),  # type: ignore[misc]
                at_least=1.5,
                at_most=2.5,
            )
        )
    return judged(
        "PS resamples about twice as often in a frame as SPS",
        "4, on figure 9",
        "twice more",
        parts,
        digits=2,
    )
