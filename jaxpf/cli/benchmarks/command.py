"""``jaxpf bench``: benchmarks on the user's machine."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.speaking import GivenPath, Speaking
from jaxpf.cli.shared.startup import start_jax

_COLD_START = """
from jaxpf.cli.shared.startup import start_jax
start_jax()
from jaxpf.papers.smith2004.scenes import RUNS_PER_SCENE, all_orderings, measure
from jaxpf.papers.smith2004.published import RUNS
chosen = {n: o for n, o in all_orderings().items() if n not in ("DPS evidence", "SPS")}
measure(range(RUNS // RUNS_PER_SCENE), orderings=chosen)
"""


@click.command("bench", cls=Speaking)
@click.option("--repeats", default=15, show_default=True, help="Number of interleaved repeats.")
@click.option("--output", "-o", type=GivenPath(), help="Also write a CSV file.")
def command(repeats: int, output: Path | None) -> None:
    """Measure speed on this machine, each figure beside its baseline.

    ns: nanoseconds per particle, partition and frame, compilation excluded; the whole kernel
    includes the histogram table.  Ratios are medians of interleaved pairs with 95 % intervals;
    trust them more than the figures.
    """
    from jaxpf.contract.errors import InputError
    from jaxpf.files.writing import check_output_file

    if repeats < 1:
        raise InputError(f"--repeats {repeats} must be at least 1.")
    if output is not None:
        check_output_file(output)
    start_jax()
    from jaxpf.cli.benchmarks import measurements

    rows: list[Any] = []
    for make in measurements.SECTIONS:
        section = make()
        rows += _show(section.title, section.rows(repeats))
    rows += _show("Turned parts: CPU time, one device", measurements.turned_parts(repeats))
    _show_memory()
    if output is not None:
        _write(rows, output)
    print_table(
        "smith2004, tables 1 and 2: 1800 runs from a cold start",
        ["", "seconds", "goal"],
        [["all, compilation included", f"{_cold_reproduction():.1f}", "< 60"]],
    )


def _show(title: str, rows: Iterable[Any]) -> list[Any]:
    rows = list(rows)
    print_table(
        title,
        ["", "ns", "ratio", "95 % interval", "of", "goal"],
        [
            [
                row.what,
                f"{row.nanoseconds:.1f}",
                f"{row.ratio:.2f}",
                f"[{row.low:.2f}, {row.high:.2f}]" if row.of else "",
                row.of,
                row.goal,
            ]
            for row in rows
        ],
    )
    return rows


def _show_memory() -> None:
    from jaxpf.cli.benchmarks import memory
    from jaxpf.cli.benchmarks.problems import line_tracker

    print_table(
        "Memory of a run with 10 000 particles",
        ["frames", "bytes"],
        [[str(frames), str(size)] for frames, size in memory.of_runs(line_tracker(10_000), 1)],
    )
    print_table(
        f"Megabytes of a gradient: {memory.RUNS} runs, {memory.PARTICLES} particles, one partition",
        ["frames", "all kept", "each frame again", f"windows of {memory.WINDOW}"],
        [
            [str(frames), *(f"{size / 1e6:.1f}" for size in sizes)]
            for frames, sizes in memory.of_gradients()
        ],
    )


def _cold_reproduction() -> float:
    """Seconds for smith2004's tables 1 and 2 in a new process without compiled kernels.

    4 values of sharpness x (50 runs of Non-PS, 7 x 50 of PS, 50 of DPS): 1800 runs.
    """
    with tempfile.TemporaryDirectory() as empty:
        environment = os.environ | {"JAXPF_CACHE_DIR": empty}
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", _COLD_START], env=environment, check=True)
        return time.perf_counter() - began


def _write(rows: list[Any], output: Path) -> None:
    from jaxpf.files.writing import csv_text, write_text

    lines = [[x if isinstance(x, str) else f"{x:.6g}" for x in row] for row in rows]
    write_text(output, csv_text([rows[0]._fields, *lines]))
    click.echo(f"{output}: written")
