"""What the paper concludes from figures 8 to 11 and table 1, judged by our runs.

Every claim on the figures is judged under both dynamics, with the paper's swap and with the
unbiased one.  Beside those on figure 8, which are at equal N, stand claims of our own at equal
time, with as many particles of SPS as take the time of PS.

Criteria that were changed after 50 runs had been judged, and why: errors are compared by the
geometric mean of the sequences' ratios, for the plain one counts a method as worse that loses as
much by turns as PS does; and "usually not more than 4 % slower" asks for most cells of table 1
where a mean of the cells asked for something else.  After 200: claims at equal time speak of every
N that can be set against another, where they spoke of one.
"""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from jaxpf.evaluation.equal_time import between, times_of
from jaxpf.measures import metrics
from jaxpf.ordering import named
from jaxpf.papers.gonzales2011.measure import Found
from jaxpf.papers.gonzales2011.published import (
    FIGURE_8_PARTS,
    FIGURE_9_PARTICLES,
    FIGURE_10_PARTICLES,
    FIGURE_11_PARTICLES,
    FIGURE_11_PARTS,
    SLIP,
    TABLE_1,
    TABLE_1_PARTICLES,
)
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, Outcome, Outcomes
from jaxpf.papers.gonzales2011.tables import by_scene, gain
from jaxpf.papers.gonzales2011.times import AT_MOST, METHODS, Times
from jaxpf.papers.judging.claims import Claim, Quantity, exact, judged, wilson
from jaxpf.papers.judging.estimates import ratio_of

_SWAPS = ("SPS sorted", "SPS combinatorial")
#: Per cent of PS's error or variance within which a method counts as equal.
MARGIN = 3.0
#: "Twice more": a ratio between these.
_TWICE = 1.5, 2.5

Cell = tuple[str, int, int]


def claims(found: Found) -> list[Claim]:
    """All claims with their verdicts; those of which no cell was run are left out."""
    return [
        *curve_claims(found.outcomes),
        *time_claims(found.times),
        *equal_time_claims(found.outcomes, {**found.times, **found.others}),
    ]


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
        ("Under erratic motion the variance is lower", "figure 11", erratic, "variance"),
    ]
    for statement, figure, cells, measure in stated:
        chosen = [cell for cell in cells if cell in outcomes]
        if chosen:
            yield judged(
                f"{statement} [{method}, {dynamics}; % less than PS]",
                f"4, {figure}",
                "a curve below PS's",
                *(
                    _less_than_ps(outcomes[cell], measure, dynamics, method, _name(cell, chosen))
                    for cell in chosen
                ),
                digits=1,
            )


def _less_than_ps(
    outcome: Outcome, measure: str, dynamics: str, method: str, what: str
) -> Quantity:
    values = getattr(outcome, measure)
    ours, base = (by_scene(values[dynamics, name]) for name in (method, "PS"))
    return gain(ours, base, what, at_least=0, margin=MARGIN)


def equal_time_claims(outcomes: Outcomes, times: Times) -> list[Claim]:
    """Figure 8 at equal time: our own, from its errors and from table 1's times.

    The number of particles of SPS that takes PS's time, and its error there, are read off straight
    lines over logarithms, as in ``jaxpf.evaluation.equal_time``; the error sequence by sequence.
    Intervals reach over what is read off at either end of the 95 % interval of the times' ratio.
    """
    found = []
    for dynamics in DYNAMICS:
        for method in _SWAPS:
            for num_parts in FIGURE_8_PARTS:
                parts = _at_equal_time(outcomes, times, dynamics, method, num_parts)
                if parts:
                    found.append(
                        judged(
                            f"Beyond the paper: SPS follows {num_parts} parts more closely than "
                            "PS with every N that SPS can be set against at equal time "
                            f"[{method}, {dynamics}; % less than PS]",
                            "figure 8 with table 1",
                            "equal N alone",
                            *parts,
                            digits=1,
                        )
                    )
    return found


def _at_equal_time(
    outcomes: Outcomes, times: Times, dynamics: str, method: str, num_parts: int
) -> list[Quantity]:
    """A quantity for every N of PS whose time lies between those of two N of SPS."""
    tracked = sorted(
        number for motion, parts, number in outcomes if (motion, parts) == ("smooth", num_parts)
    )
    timed = [number for number in tracked if (num_parts, number) in times]

    def seconds(name: str) -> np.ndarray:
        return times_of([1 / np.median(times[num_parts, number][name]) for number in timed])

    def errors(name: str, number: int) -> np.ndarray:
        return by_scene(outcomes["smooth", num_parts, number].error[dynamics, name])

    def read_off(number: int, spent: float) -> Quantity | None:
        if (among := between(seconds(method), spent)) is None:
            return None
        place, share = among
        affords = timed[place] ** (1 - share) * timed[place + 1] ** share
        if (among := between(tracked, affords)) is None:
            return None
        place, share = among
        fewer, more = (errors(method, each) for each in tracked[place : place + 2])
        return gain(
            (1 - share) * fewer + share * more,
            errors("PS", number),
            f"N = {number}, of SPS {affords:.0f}",
            at_least=0,
            margin=MARGIN,
        )

    found = []
    for number, spent in zip(timed, seconds("PS"), strict=False):
        both = times[num_parts, number]
        ratio = ratio_of(both["PS"], both[method])
        ends = [float(spent) * end / ratio.value for end in ratio.interval(0.95)]
        read = [read_off(number, each) for each in (float(spent), *ends)]
        known = [each for each in read if each is not None]
        if len(known) == len(read):
            found.append(known[0]._replace(interval=partial(_widest, known)))
    return found


def _widest(parts: Sequence[Quantity], level: float) -> tuple[float, float]:
    """From the lowest end of the parts' intervals to the highest."""
    lows, highs = zip(*(part.interval(level) for part in parts), strict=True)
    return min(lows), max(highs)


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
    limit = 100 * (AT_MOST - 1)
    slower = {
        (num_parts, number): 100 * (other / one - 1)
        for num_parts, rows in TABLE_1.items()
        for number, one, other in zip(TABLE_1_PARTICLES, rows["PS"], rows["SPS"], strict=True)
    }
    within = sum(excess <= limit for excess in slower.values())
    mean = np.mean([each for cell, each in slower.items() if cell != (SLIP[0], SLIP[2])])
    found = []
    for method in METHODS[1:]:
        # The cells are the units: each has its own compiled kernel and its own overhead.
        excess = np.array(
            [100 * (np.median(cell[method] / cell["PS"]) - 1) for cell in times.values()]
        )
        usual = int((excess <= limit).sum())
        found.append(
            judged(
                f"SPS is usually (in most cells) not more than 4 % slower than PS [{method}]",
                "4, table 1",
                f"in {within} of {len(slower)} cells; {mean:.1f} % on average, without a misprint",
                Quantity(
                    "cells, %",
                    100 * usual / len(excess),
                    wilson(usual, len(excess)),
                    at_least=50,
                ),
                unit="cells",
            )
        )
    return found
