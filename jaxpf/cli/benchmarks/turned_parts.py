"""What PS and SPS cost of an articulated object: gonzales2011's largest, all runs batched."""

from collections.abc import Iterator

from jaxpf.cli.benchmarks.rows import Row, compared
from jaxpf.papers.gonzales2011 import times
from jaxpf.papers.gonzales2011.published import FRAMES, RUNS

TITLE = f"Turned parts: {RUNS} runs, {times.LARGEST[1]} particles; CPU time, one device"


def rows(repeats: int, runs: int = RUNS, num_frames: int = 10) -> Iterator[Row]:
    """Table 1's largest cell with all runs of a figure batched."""
    parts, particles = times.LARGEST
    seconds = times.measure_times((parts,), (particles,), num_frames, repeats, runs)[times.LARGEST]
    for method in times.METHODS:
        goal = {"PS": f"<= {times.GOAL} ns", "SPS combinatorial": f"<= {times.AT_MOST}"}
        yield compared(
            f"{parts} parts, {method}",
            seconds[method],
            parts * particles * FRAMES,
            seconds["PS"],
            "this / PS",
            goal.get(method, ""),
        )
