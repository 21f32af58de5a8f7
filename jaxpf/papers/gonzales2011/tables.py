"""Figures 8 to 11 as tables."""

from jaxpf.files.tables import Table
from jaxpf.papers.gonzales2011.measures import MEASURES
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, METHODS, Outcomes
from jaxpf.papers.judging.measures import case_table


def tables(outcomes: Outcomes) -> list[Table]:
    """Errors and variances of every cell, and the reduction of SPS relative to PS."""
    tables = []
    for dynamics in DYNAMICS:
        variants = {method: f"{method}, {dynamics}" for method in METHODS}
        tables += [
            case_table(
                outcomes,
                f"{name}_{dynamics}",
                f"{title}, {dynamics} dynamics",
                {method: (MEASURES[name], variant) for method, variant in variants.items()},
                note,
            )
            for name, title, note in (
                (
                    "error",
                    "Figures 8, 10, 11: sum of corner distances (pixels)",
                    "Mean over frames; the paper has curves without numbers.",
                ),
                ("variance", "Figures 9, 11: variance of the particle set (pixels^2)", ""),
            )
        ]
        tables.append(
            case_table(
                outcomes,
                f"gain_{dynamics}",
                f"How much less than PS (%), {dynamics} dynamics: error, then variance",
                {
                    f"{name}, {method}": (
                        MEASURES[name]._replace(digits=1),
                        variants[method],
                        variants["PS"],
                    )
                    for name in ("error", "variance")
                    for method in METHODS[1:]
                },
                "Sequence by sequence, with the same seeds; above 0, SPS is better.  One less the "
                "geometric mean of the ratios.",
            )
        )
    return tables
