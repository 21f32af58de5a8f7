"""``jaxpf bench``: the table of costs on the user's machine."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from jaxpf.cli import common


@click.command("bench")
@click.option("--repeats", default=15, show_default=True, help="Interleaved repeats.")
@click.option(
    "--scaling", is_flag=True, help="Also how cost grows with N, P and R, to N = 10^6 (2 minutes)."
)
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="CSV file to write, too; with --scaling, the curves in a PNG file beside it.",
)
def command(repeats: int, scaling: bool, output: Path | None) -> None:
    """Measure speed on this machine, each figure beside its baseline.

    ns: nanoseconds per particle, partition and frame, compilation excluded; the whole
    kernel includes the histogram table.  Ratios are medians of interleaved pairs with 95 %
    intervals; trust them more than the figures.
    """
    from jaxpf.errors import InputError

    if repeats < 1:
        raise InputError(f"--repeats {repeats} must be at least 1.")
    if output is not None:
        from jaxpf.files.writing import check_output_file

        if scaling and output.suffix == ".png":
            raise InputError(f"--output {output} is where the curves go; name the CSV file.")
        check_output_file(output)
    common.start_jax()
    from jaxpf.experiments import (
        appearance_costs,
        contour_costs,
        gradient_costs,
        labelled_costs,
        speed,
    )
    from jaxpf.experiments.eskil2014 import costs as point_costs
    from jaxpf.experiments.gonzales2011 import costs

    rows: list[Any] = []
    sections = [
        ("Histogram likelihood (table excluded)", speed.histogram_rows(repeats)),
        (
            f"Contour likelihood: {contour_costs.LINES} lines of {contour_costs.SAMPLES} samples "
            "(gradient excluded; per hypothesis)",
            contour_costs.rows(repeats),
        ),
        ("Whole kernel: 50 runs, 300 particles, 7 objects, 360x288", speed.kernel_rows(repeats)),
        (
            f"Learned appearance: whole kernel, {appearance_costs.PARTICLES} particles",
            appearance_costs.rows(repeats),
        ),
        (
            f"Turned parts: {costs.RUNS} runs, {costs.PARTICLES} particles; CPU time, one device",
            costs.rows(repeats),
        ),
        (
            f"Labelled particles: {labelled_costs.RUNS} runs, {labelled_costs.PARTICLES} "
            "particles; CPU time, one device",
            labelled_costs.rows(repeats),
        ),
        ("Generic kernel: 1-D model, 50 runs, 1000 particles", speed.generic_rows(repeats)),
        (
            f"Points: {point_costs.POINTS}, {point_costs.HEIGHT}x{point_costs.WIDTH}, one run; "
            "decoding left out",
            point_costs.rows(repeats),
        ),
        (f"Gradient of the evidence: {gradient_costs.RUNS} runs", gradient_costs.rows(repeats)),
    ]
    for title, section in sections:
        rows += _show(title, section)
    if scaling:
        rows += _show_growth(output)
    memory = list(speed.memory_rows())
    common.print_table(
        "Memory of a run with 10 000 particles",
        ["frames", "bytes"],
        [[str(frames), str(size)] for frames, size in memory],
    )
    common.print_table(
        f"Megabytes of a gradient: {gradient_costs.RUNS} runs, {gradient_costs.PARTICLES} "
        "particles, one partition",
        ["frames", "all kept", "each frame again", f"windows of {gradient_costs.WINDOW}"],
        [
            [str(frames), *(f"{size / 1e6:.1f}" for size in sizes)]
            for frames, sizes in gradient_costs.memory_rows()
        ],
    )
    common.print_table(
        f"Labelled particles, 1-D model, {labelled_costs.PER_TARGET} particles per target "
        "(constant ns: linear)",
        ["targets", "ns per particle and frame"],
        [[str(targets), f"{ns:.1f}"] for targets, ns in labelled_costs.growth()],
    )
    if output is not None:
        from jaxpf.files.writing import atomic_write

        with atomic_write(output) as file:
            file.write(",".join(speed.Row._fields) + "\n")
            for row in rows:
                file.write(",".join(f'"{x}"' if isinstance(x, str) else f"{x:.6g}" for x in row))
                file.write("\n")
        click.echo(f"{output}: written")
    common.print_table(
        "smith2004, tables 1 and 2: 1800 runs from a cold start",
        ["", "seconds", "goal"],
        [["all, compilation included", f"{speed.cold_reproduction():.1f}", "< 60"]],
    )


def _show_growth(output: Path | None) -> list[Any]:
    from jaxpf.experiments import growth, speed
    from jaxpf.media import plotting

    found = list(growth.growth())
    common.print_table(
        "Growth of cost: 1-D model, one device (constant ns: linear)",
        ["particles", "partitions", "runs", "ns"],
        [[str(g.particles), str(g.partitions), str(g.runs), f"{g.nanoseconds:.1f}"] for g in found],
    )
    if output is not None:
        picture = output.with_suffix(".png")
        plotting.save_figure(growth.growth_figure(found), picture)
        click.echo(f"{picture}: written")
    no_ratio = (float("nan"),) * 3
    names = [f"N = {g.particles}, P = {g.partitions}, R = {g.runs}" for g in found]
    return [
        speed.Row(name, g.nanoseconds, *no_ratio, "", "")
        for name, g in zip(names, found, strict=True)
    ]


def _show(title: str, section: Iterable[Any]) -> list[Any]:
    rows = list(section)
    common.print_table(
        title,
        ["", "ns", "ratio", "95 % interval", "of", "goal"],
        [
            [
                row.what,
                f"{row.nanoseconds:.1f}",
                "" if row.ratio != row.ratio else f"{row.ratio:.2f}",
                "" if not row.of else f"[{row.low:.2f}, {row.high:.2f}]",
                row.of,
                row.goal,
            ]
            for row in rows
        ],
    )
    return rows
