"""Writes an evaluation's figures, with captions, as PNG and PDF reproducible byte for byte."""

import base64
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from matplotlib import rc_context
from matplotlib.rcsetup import cycler

from jaxpf.evaluation.measuring.overview import Overview
from jaxpf.evaluation.output import charts
from jaxpf.evaluation.work.results import Results
from jaxpf.files.writing import atomic_write, remove_leavings, report_os_errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

_STYLE: dict[Any, Any] = {
    "text.parse_math": False,  # names may contain dollar signs
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "pdf.fonttype": 42,  # embed TrueType fonts, which publishers require
}


class Figure(NamedTuple):
    """A saved figure.

    Attributes:
        name: of the files, without suffix.
        title: of the figure.
        caption: how to read it and how its intervals are computed.
        png: path of the PNG file.
        size: width and height in inches.
    """

    name: str
    title: str
    caption: str
    png: Path
    size: tuple[float, float]

    @property
    def data(self) -> str:
        """The PNG file as text, for a page that needs no other file."""
        return base64.b64encode(self.png.read_bytes()).decode("ascii")


def write_figures(results: Results, overview: Overview) -> list[Figure]:
    """Write all figures into the folder ``figures`` of the evaluation.

    Raises:
        InputError: a file cannot be written.
    """
    folder = results.folder / "figures"
    with report_os_errors("create the folder", folder):
        folder.mkdir(exist_ok=True)
    remove_leavings(folder)
    written = []
    with in_style():
        for name, title, caption, drawn in _drawn(results, overview):
            path = folder / f"{name}.png"
            save(drawn, path)
            written.append(Figure(name, title, caption, path, tuple(drawn.get_size_inches())))
    return written


def in_style() -> AbstractContextManager[None]:
    """Context manager with the style for drawing and saving figures."""
    # Seven colours, then the same colours dashed.
    styles = cycler(linestyle=("-", "--")) * cycler(color=charts.COLOURS)
    return rc_context({**_STYLE, "axes.prop_cycle": styles})


def save(figure: "Drawing", png: str | os.PathLike[str]) -> None:
    """Write ``png`` and a PDF next to it, both without a creation date."""
    # Lay out once for both files, because the layout is slow.
    figure.draw_without_rendering()
    figure.set_layout_engine(None)
    with atomic_write(png, "wb") as file:
        figure.savefig(file, dpi=130, format="png", metadata={"Software": None})
    metadata = {"CreationDate": None, "Creator": None, "Producer": None}
    with atomic_write(Path(png).with_suffix(".pdf"), "wb") as file:
        figure.savefig(file, format="pdf", metadata=metadata)


def _drawn(results: Results, overview: Overview) -> "Iterator[tuple[str, str, str, Drawing]]":
    """Yield name, title, caption and drawing of each figure of the best configurations."""
    summaries, best = overview.summaries, overview.ranked[: charts.MOST_LINES]
    calibrated = [summary for summary in best if summary.pit_values.any()]
    confident = [summary for summary in best if summary.confidence.frames[-1]]
    shown = f" The best {len(best)} of {len(summaries)} configurations."
    shown = shown if len(best) < len(summaries) else ""
    if not best:
        return
    curves = {
        (summary.name, name): [x[-1] for x in (curve.value, curve.lower, curve.upper)]
        for summary in best
        for name in charts.CURVES
        for curve in [getattr(summary, name)]
    }
    yield (
        "success-curves",
        "Success and precision curves",
        "Share of the frames whose IoU with the truth exceeds a threshold, and of those whose "
        "centre error is at most a threshold (wu2013), without the start frame. Bands: 95% "
        "intervals over runs. In brackets: the area under the success curve, and the "
        "precision within 20 pixels." + shown,
        charts.accuracy_curves([summary.name for summary in best], curves),
    )
    yield (
        "error-over-time",
        "Centre error over time",
        "Line: median over runs and objects. Dark band: the middle half. Pale band: from 5 to "
        "95%. These are quantiles, not intervals; frames without truth or estimate do not count."
        + shown,
        charts.error_over_time(results.start_frame + 1, best),
    )
    if calibrated:
        yield (
            "calibration",
            "Calibration",
            "How often the central region of a given probability covers the truth: x and y of all "
            "objects, in frames in which the object is tracked. On the dotted line intervals are "
            "calibrated, below it they are too narrow." + shown,
            charts.calibration(calibrated),
        )
    if confident:
        yield (
            "confidence",
            "Reliability of confidence",
            "Share of the boxes on their object, in five bins of confidence. On the dotted line "
            "confidence is calibrated, below it too high. Bars: 95% intervals over runs." + shown,
            charts.confidence(confident),
        )
    if lines := charts.lines_over_particles(summaries):
        yield (
            "against-time",
            "Accuracy against time",
            "Lines join numbers of particles. Time: of one run alone on this machine, from a "
            "frame in memory to its estimate. Bars: 95% intervals over runs. Of two methods, the "
            "higher on the left, or the lower on the right, is better at equal time.",
            charts.against_time(lines),
        )
