"""``jaxpf bench``: the table of costs on the user's machine."""

import importlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.speaking import Speaking
from jaxpf.cli.shared.startup import start_jax


@click.command("bench", cls=Speaking)
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
    from jaxpf.contract.errors import InputError

    if repeats < 1:
        raise InputError(f"--repeats {repeats} must be at least 1.")
    if output is not None:
        from jaxpf.files.writing import check_output_file

        if scaling and output.suffix == ".png":
            raise InputError(f"--output {output} is where the curves go; name the CSV file.")
        check_output_file(output)
    start_jax()
    from jaxpf.cli.benchmarks import SECTIONS

    rows: list[Any] = []
    for name in SECTIONS:
        section: Any = importlib.import_module(f"jaxpf.cli.benchmarks.{name}")
        rows += _show(section.TITLE, section.rows(repeats))
    if scaling:
        rows += _show_growth(output)
    _show_memory()
    if output is not None:
        _write(rows, output)
    from jaxpf.cli.benchmarks.cold_start import cold_reproduction

    print_table(
        "smith2004, tables 1 and 2: 1800 runs from a cold start",
        ["", "seconds", "goal"],
        [["all, compilation included", f"{cold_reproduction():.1f}", "< 60"]],
    )


def _show(title: str, section: Iterable[Any]) -> list[Any]:
    rows = list(section)
    print_table(
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


def _show_growth(output: Path | None) -> list[Any]:
    from jaxpf.cli.benchmarks.growth import growth, growth_figure
    from jaxpf.cli.benchmarks.rows import Row
    from jaxpf.media import plotting

    found = list(growth())
    print_table(
        "Growth of cost: 1-D model, one device (constant ns: linear)",
        ["particles", "partitions", "runs", "ns"],
        [[str(g.particles), str(g.partitions), str(g.runs), f"{g.nanoseconds:.1f}"] for g in found],
    )
    if output is not None:
        picture = output.with_suffix(".png")
        plotting.save_figure(growth_figure(found), picture)
        click.echo(f"{picture}: written")
    no_ratio = (float("nan"),) * 3
    names = [f"N = {g.particles}, P = {g.partitions}, R = {g.runs}" for g in found]
    return [Row(n, g.nanoseconds, *no_ratio, "", "") for n, g in zip(names, found, strict=True)]


def _show_memory() -> None:
    from jaxpf.cli.benchmarks import gradients, growth, memory
    from jaxpf.cli.benchmarks.problems import line_tracker

    print_table(
        "Memory of a run with 10 000 particles",
        ["frames", "bytes"],
        [[str(frames), str(size)] for frames, size in memory.of_runs(line_tracker(10_000), 1)],
    )
    print_table(
        f"Megabytes of a gradient: {gradients.RUNS} runs, {gradients.PARTICLES} particles, one "
        "partition",
        ["frames", "all kept", "each frame again", f"windows of {memory.WINDOW}"],
        [
            [str(frames), *(f"{size / 1e6:.1f}" for size in sizes)]
            for frames, sizes in memory.of_gradients()
        ],
    )
    print_table(
        f"Labelled particles, 1-D model, {growth.PER_TARGET} particles per target "
        "(constant ns: linear)",
        ["targets", "ns per particle and frame"],
        [[str(targets), f"{ns:.1f}"] for targets, ns in growth.of_targets()],
    )


def _write(rows: Iterable[Any], output: Path) -> None:
    from jaxpf.cli.benchmarks.rows import Row
    from jaxpf.files.writing import atomic_write

    with atomic_write(output) as file:
        file.write(",".join(Row._fields) + "\n")
        for row in rows:
            file.write(",".join(f'"{x}"' if isinstance(x, str) else f"{x:.6g}" for x in row))
            file.write("\n")
    click.echo(f"{output}: written")
