"""``jaxpf bench``: benchmarks on the user's machine."""

import click

from jaxpf.cli.shared.console import print_table
from jaxpf.cli.shared.plain import PlainCommand, whole
from jaxpf.cli.shared.startup import start_jax


@click.command("bench", cls=PlainCommand)
@whole("--repeats", default=15, least=1, most=10_000, help="Number of interleaved repeats.")
def command(repeats: int) -> None:
    """Measure speed on this machine, each figure beside its baseline.

    ns: nanoseconds per particle, partition and frame, compilation excluded; the whole kernel
    includes the histogram table.  Ratios to the baseline's time are medians of interleaved pairs
    with 95% intervals (from six repeats on).  On a shared machine trust them more than the
    nanoseconds.
    """
    start_jax()
    from jaxpf.cli.benchmarks import measurements

    for make in measurements.SECTIONS:
        section = make()
        rows = []
        for case, (nanoseconds, ratio) in zip(section.cases, section.measure(repeats), strict=True):
            value, _, low, high = ratio
            ends = f"[{low:.2f}, {high:.2f}]" if low < high else ""
            shown = [f"{value:.2f}", ends] if case.baseline else ["", ""]
            rows.append([case.what, f"{nanoseconds:.1f}", *shown, case.baseline, case.goal])
        columns = ["", "ns", "ratio", "95% interval", "to", "goal"]
        print_table(section.title, columns, rows)
