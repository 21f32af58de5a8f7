"""Write the stored figures that README and pages quote, each between its two marks.

``python notebooks/docs/figures.py``; the site's build does the same, and a test says that nothing
changes.  ``<!-- NAME -->...<!-- / -->`` holds the block NAME of ``development/figures.toml``, in
which every ``{FIGURE}`` is filled in, or the figure NAME itself.  A figure is, divided by "; ":

- the name of a table in ``figures.toml``, how a row begins, and a column; or of a value there;
- a function of ``FIGURES``, below, and its arguments: of ``boxes.csv``, or of the program;
- the way in which a figure is written, one of ``FORMS``, and this figure.
"""

import csv
import functools
import math
import re
import tomllib
from pathlib import Path

import numpy as np

from jaxpf import points
from jaxpf.contract.calls import model_error
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood
from jaxpf.measures import difference_interval, mean_interval, median_interval
from jaxpf.papers.judging import verdicts

SITE = Path(__file__).resolve().parent
NOTES = SITE / "development"
PAGES = [SITE.parents[1] / "README.md", SITE.parent / "index.md", *sorted(SITE.rglob("*.md"))]
MARKED = re.compile(r"<!-- ([^>]+) -->(.*?)<!-- / -->", re.S)
SOURCES = tomllib.loads((NOTES / "figures.toml").read_text())
TRACKERS = ("default", "pretrained", "csrt", "dlib")


def cell(table, row, column):
    """A cell of a heading's first table with this column, with zeros before points."""
    page, heading = SOURCES["tables"][table]
    _, below = (SITE / page).read_text().split(f"# {heading}\n", 1)
    lines = re.split(r"^#", below, flags=re.M)[0].splitlines()
    cells = [[each.strip() for each in x[1:-1].split("|")] for x in lines if x.startswith("|")]
    head = next(number for number, each in enumerate(cells) if column in each)
    found = min((each for each in cells[head:] if each[0].startswith(row)), key=lambda x: len(x[0]))
    return re.sub(r"(?<![\w.])\.(?=\d)", "0.", found[cells[head].index(column)])


def by_clip(tracker, column, part="report"):
    """Clip -> what a tracker of boxes measured on it."""
    with (NOTES / "boxes.csv").open(newline="") as file:
        mine = [x for x in csv.DictReader(file) if (x["tracker"], x["set"]) == (tracker, part)]
    return {row["clip"]: float(row[column]) for row in mine if row[column]}


def with_ends(found, digits):
    value, low, high = (round(x, digits) + 0 for x in (found.value, found.lower, found.upper))
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def mean(tracker, column, digits, part="report"):
    """Mean over clips with its interval; of widths the median."""
    if not (values := np.array(list(by_clip(tracker, column, part).values()))).size:
        return "—"
    is_width = column == "width"
    found = median_interval(values) if is_width else mean_interval(values, bounds=(0, 1))
    return with_ends(found, int(digits))


def on_clip(name, column, digits):
    values = (by_clip(tracker, column).get(name) for tracker in TRACKERS)
    return " | ".join("" if value is None else f"{value:.{digits}f}" for value in values)


def overlaps(other, part):
    """Those of pretrained features, and of another tracker, clip by clip."""
    ours, theirs = by_clip("pretrained", "iou", part), by_clip(other, "iou", part)
    return np.array([(ours[clip], theirs[clip]) for clip in ours.keys() | theirs.keys()]).T


def gain(other, part="report"):
    """Overlap of pretrained features minus another tracker's."""
    text = with_ends(difference_interval(*overlaps(other, part), bounds=(0, 1)), 3)
    return text if text.startswith("-") else f"+{text}"


def point_reach(times=1):
    """Least reach of a keypoint's interval to a side, by the error that a tracker declares."""
    frame = np.random.default_rng(0).integers(0, 256, (40, 40, 3), np.uint8)
    error = model_error(points.tracker(frame, [[20, 20]]), 1)[0, 0]
    return f"{1.96 * error * int(times)}"


FIGURES = {
    "mean": mean,
    "means": lambda *of: " | ".join(mean(tracker, *of) for tracker in TRACKERS),
    "on clip": on_clip,
    "average": lambda *of: f"{np.mean([*by_clip(*of[:2]).values()]):.{of[2]}f}",
    "gain": gain,
    "better": lambda other, part="report": f"{np.sum(np.greater(*overlaps(other, part)))}",
    # Least reach of a box's size either way, by the error that the likelihood declares.
    "box factor": lambda: f"{math.exp(1.96 * DiscriminativeLikelihood.model_error[2]):.1f}",
    "point reach": point_reach,
    "verdicts": lambda: "\n".join(verdicts.summary(x, verdicts.stored(x)) for x in verdicts.FORMS),
}


def scaled(text, scale, digits):
    return re.sub(r"\d+(\.\d+)?", lambda x: f"{float(x[0]) * scale:.{digits}f}", text)


FORMS = {
    "alone": lambda text: text.split(" ")[0],
    "last": lambda text: text.split(", ")[-1],
    "unsigned": lambda text: text.removeprefix("+"),
    "%": lambda text: re.sub("^[^ ]+", r"\g<0>%", text),
    "whole": functools.partial(scaled, scale=1, digits=0),
    "percent": functools.partial(scaled, scale=100, digits=0),
    "thousandth": functools.partial(scaled, scale=1e-3, digits=2),
}


def figure(name):
    first, *others = name.split("; ")
    if first in FORMS:
        return FORMS[first](figure("; ".join(others)))
    if first in FIGURES:
        return FIGURES[first](*others)
    return cell(first, *others) if others else SOURCES["values"][first]["text"]


def filled(page):
    """A page's text with all figures as they are stored; notes have no zeros before points."""

    def text(found):
        block = SOURCES["blocks"].get(found[1])
        template = f"\n\n{block}\n" if block else f"{{{found[1]}}}"
        new = re.sub(r"\{([^}]+)\}", lambda x: figure(x[1]), template)
        new = re.sub(r"(?<![\d.])0\.(?=\d)", ".", new) if page.parent == NOTES else new
        return f"<!-- {found[1]} -->{new}<!-- / -->"

    return MARKED.sub(text, page.read_text())


def write():
    """Write every page whose figures differ; returns their names."""
    changed = {page: new for page in PAGES if (new := filled(page)) != page.read_text()}
    for page, new in changed.items():
        page.write_text(new)
    return [page.name for page in changed]


if __name__ == "__main__":
    print("changed:", *write() or ["nothing"])
