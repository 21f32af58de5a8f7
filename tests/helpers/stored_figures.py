"""Stored figures, read from tables and sentences of the site, for tests of what quotes them."""

import csv
import math
import re
from pathlib import Path

import numpy as np

from jaxpf import contract, points
from jaxpf.likelihoods import DiscriminativeLikelihood
from jaxpf.measures import difference_interval, mean_interval, median_interval

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "notebooks" / "docs"
#: Half of a normal 95% interval, in standard deviations.
HALF = 1.96


def read(page):
    """A page, with zeros before points."""
    return re.sub(r"(?<![\w.])\.(?=\d)", "0.", page.read_text())


def section(page, heading):
    """What stands below a heading, up to the next of its level or above."""
    marks, rest = re.search(rf"^(#+) {re.escape(heading)}\n(.*)", page, re.M | re.S).groups()
    return re.split(rf"^#{{1,{len(marks)}}} ", rest, flags=re.M)[0]


def tables(text):
    """Every table of a text: its rows, each a mapping of the head's cells to its own."""
    for block in re.findall(r"(?:^\|.*\n)+", text, re.M):
        head, _, *rows = (
            [cell.replace("*", "").strip() for cell in line.strip().strip("|").split("|")]
            for line in block.splitlines()
        )
        yield [dict(zip(head, row, strict=True)) for row in rows]


def rows(text, number=0):
    """First cell -> row, of a text's table of this number."""
    table = list(tables(text))[number]
    return {next(iter(row.values())): row for row in table}


def prose(text):
    return re.sub(r"\s+", " ", text)


def percent(cell):
    """ "0.87 [0.70, 1.00]" -> "87% [70, 100]"."""
    value, *ends = (f"{100 * float(x):.0f}" for x in re.findall(r"[\d.]+", cell))
    return f"{value}% [{', '.join(ends)}]"


def negated(cell):
    """ "-0.037 [-0.078, 0.000]" -> "+0.037 [0.000, 0.078]"."""
    value, low, high = (-float(x) for x in re.findall(r"-?[\d.]+", cell))
    return f"{value:+.3f} [{high + 0:.3f}, {low + 0:.3f}]"


DEFAULTS = read(SITE / "development" / "defaults.md")
TEST_CLIPS = rows(section(DEFAULTS, "Boxes on the test clips"))
(SIZE_COVERED,) = (TEST_CLIPS[name]["jaxpf"] for name in TEST_CLIPS if name.startswith("size in"))
(CENTRE_COVERED,) = (TEST_CLIPS[n]["jaxpf"] for n in TEST_CLIPS if n.startswith("centre in"))
(CONFIDENCE,) = (TEST_CLIPS[name]["jaxpf"] for name in TEST_CLIPS if name.startswith("confidence"))
COVERAGE = "Does the 95% region hold the truth in 95% of the frames?"
DIFFERENCE = "overlap: jaxpf minus the other, paired by clip"
#: "45 to 49%" of the labelled keypoints of the test clips.
(POINTS_LOST,) = re.findall(
    r"cautious: (.+?) of the labels are said to be lost",
    prose(section(DEFAULTS, "Before and after")),
)
HELD_OUT = prose(section(DEFAULTS, "Held-out clips, with an earlier default"))
PRETRAINED = rows(section(DEFAULTS, "Boxes by pretrained features"))
GPU = rows(section(read(SITE / "gpu.md"), "Suitable workloads"))
SERIES = rows(section(read(SITE / "state_space.md"), "Comparison with other libraries"))
BLACKJAX = "blackjax 1.7.1, `smc.base.step` in a `scan`"


def by_clip(tracker, column, part="report"):
    """Clip -> what a tracker of boxes measured on it."""
    with (SITE / "development" / "boxes.csv").open(newline="") as file:
        table = [row for row in csv.DictReader(file) if row["set"] == part]
    mine = (row for row in table if row["tracker"] == tracker)
    return {row["clip"]: float(row[column]) for row in mine if row[column]}


def shown(found, digits):
    """An estimate with its interval over clips, as the page prints it."""
    value, low, high = (round(x, digits) + 0 for x in (found.value, found.lower, found.upper))
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def with_ends(values, digits, is_share=True):
    """A mean of shares, or a median."""
    values = np.array(list(values))
    found = mean_interval(values, bounds=(0, 1)) if is_share else median_interval(values)
    return shown(found, digits)


def gained(other, part="report"):
    """IoU of pretrained minus another tracker's, with its interval."""
    ours, theirs = by_clip("pretrained", "iou", part), by_clip(other, "iou", part)
    pairs = np.array([(ours[clip], theirs[clip]) for clip in ours.keys() | theirs.keys()])
    return shown(difference_interval(*pairs.T, bounds=(0, 1)), 3)


def silent(tracker):
    """Share of all frames, in percent, in which a box is off its object and not reported lost."""
    return f"{100 * np.mean([*by_clip(tracker, 'silent').values()]):.0f}%"


def points_reported():
    """Clip -> row of the points' new defaults, on test clips."""
    table = next(tables(section(section(DEFAULTS, "Points"), "Before and after")))
    clips = [row["clip"] for row in table]
    return {name: table[clips.index(name) + 1] for name in ("cows", "flies")}


def covered(row):
    """Share, in percent, of the coordinates of points not said lost in their 95% intervals."""
    return f"{100 * float(row['not said lost'].split(', ')[1]):.0f}"


def least_factor():
    """Least reach of a box's size either way, by the error that the likelihood declares."""
    return f"{math.exp(HALF * DiscriminativeLikelihood.model_error[2]):.1f}"


def least_width():
    """Least width of a keypoint's interval, in pixels, by the error that a tracker declares."""
    frame = np.random.default_rng(0).integers(0, 256, (40, 40, 3), np.uint8)
    return 2 * HALF * contract.model_error(points.tracker(frame, [[20, 20]]), 1)[0, 0]
