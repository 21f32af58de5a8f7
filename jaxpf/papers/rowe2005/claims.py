"""The figures that judge the paper's claims, by the claims' keys."""

from jaxpf.papers.judging.claims import Quantity
from jaxpf.papers.judging.estimates import gap_of, mean_of, ratio_of, share_of
from jaxpf.papers.rowe2005 import published, tables
from jaxpf.papers.rowe2005.measure import Measurement
from jaxpf.papers.rowe2005.scenes import Outcome


def quantities(measured: Measurement) -> dict[str, list[Quantity]]:
    """Key of a claim -> its figures."""
    return of_scenes(measured.outcome, measured.crossing)


def of_scenes(outcome: Outcome, crossing: Outcome) -> dict[str, list[Quantity]]:
    """Key of a claim -> its figures; ``crossing`` holds the runs on targets that cross."""

    def less(measure) -> Quantity:
        """Measure of the filter with neither minus that of the full filter, scene by scene."""
        return mean_of(measure(outcome, "neither") - measure(outcome, "both"))

    def fewer_lost(variant: str, runs: Outcome = outcome) -> Quantity:
        """Targets lost by a variant minus those lost by the full filter, in points."""
        return gap_of(tables.lost(runs, variant), tables.lost(runs, "both"))

    low, high = published.SHARE_BAND
    shares = tables.run_share(outcome, "both")
    starved = {name: tables.starved(outcome, name) for name in ("without eq. 4", "both")}
    between = {name: outcome.between[outcome.of(name)] for name in ("Condensation", "both")}
    size = {name: tables.last_ratio(outcome, name) for name in ("both", "without size term")}
    figures = {
        "starves": share_of(starved["without eq. 4"]),
        "half": share_of((low <= shares) & (shares <= high)),
        "never_starves": share_of(starved["both"]),
        "error": less(tables.tracked_error),
        "lost_less": fewer_lost("neither"),
        "never_lost": share_of(tables.lost(outcome, "both")),
        "samples": less(tables.astray),
        "negligible": mean_of(tables.astray(outcome, "both")),
        "condensation": ratio_of(
            between["Condensation"], outcome.within[outcome.of("Condensation")]
        ),
        "proposal": ratio_of(between["Condensation"], between["both"]),
        "power": fewer_lost("without power"),
        "mean_at_strips": fewer_lost("product"),
        "mean_where_crossing": fewer_lost("product", crossing),
        "size_term": mean_of(size["both"] - size["without size term"]),
        "collapse": mean_of(size["without size term"]),
    }
    return {key: [figure] for key, figure in figures.items()}
