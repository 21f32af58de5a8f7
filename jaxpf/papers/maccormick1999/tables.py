"""Final positions of contours, and effective sample sizes."""

from jaxpf.files.tables import Table
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.judging.measures import measure_table
from jaxpf.papers.maccormick1999 import published
from jaxpf.papers.maccormick1999.measures import of_kind
from jaxpf.papers.maccormick1999.passing import (
    INDEPENDENT,
    MUCH_HIDDEN,
    WIRE_PARTICLES,
    Measurement,
)


def tables(measured: Measurement) -> list[Table]:
    """All tables, in display order."""
    wires, leaves = of_kind("wires"), of_kind("figure_11")
    return [
        measure_table(
            measured,
            "figure_4_wires",
            f"Figure 4: {counted(len(measured.wires.cases), 'sequences')} of wires, one run on "
            f"each, {WIRE_PARTICLES} particles (%)",
            {
                "both on their own": wires["kept"],
                "both on one": wires["coalesced"],
                "exchanged": wires["exchanged"],
            },
            list(measured.wires.methods),
            "Partitioned sampling, but where it says Condensation.  The paper shows one run of "
            "each likelihood on one sequence.",
            corner="likelihood",
        ),
        passing_table(measured, "leaves"),
        passing_table(measured, "walkers"),
        measure_table(
            measured,
            "figure_11",
            f"Figure 11: effective sample size, mean over {published.FIRST_FRAMES} frames",
            {"effective sample size": leaves["ess"]._replace(kind="mean")},
            list(measured.figure_11.methods),
            f"{counted(len(measured.figure_11.cases), 'sequences')} of leaves; every line counts "
            "in full.",
            corner="method",
        ),
    ]


def passing_table(measured: Measurement, kind: str) -> Table:
    """Success, labels, spread and effective sample size of every method."""
    passing, measures = getattr(measured, kind), of_kind(kind)
    table = measure_table(
        measured,
        f"passing_{kind}",
        f"{kind}: one run on every sequence",
        {
            "both kept (%)": measures["kept"],
            "both on one (%)": measures["coalesced"],
            "exchanged (%)": measures["exchanged"],
            "label right (%)": measures["label right"],
            "widening": measures["widening"],
            "narrowing": measures["narrowing"],
            f"effective sample size, {published.FIRST_FRAMES} frames": measures["ess"]._replace(
                kind="mean"
            ),
        },
        list(passing.methods),
        f"Labels are judged in the frames in which more than {100 * MUCH_HIDDEN:g}% of the "
        "farther outline is hidden.  Widening is the spread of the hidden contour at the height "
        "of the occlusion over that just before, narrowing that some frames after over that at the "
        "height; both are of runs that keep both.  SIR, and every method for walkers, "
        "is ordinary Condensation.",
        corner="method",
    )
    for name, row in table.rows:
        if name == INDEPENDENT:  # resampled apart, so that joint particles have equal weights
            row[-1] = "-"
    table.add("N", [str(method.num_particles) for method in passing.methods.values()])
    table.add("sequences", [str(len(passing.outcomes[name])) for name in passing.methods])
    return table
