"""Writes the report of an evaluation: one self-contained HTML file without scripts."""

import json
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2

from jaxpf.evaluation.figures import write_figures
from jaxpf.evaluation.measures import ON_OBJECT
from jaxpf.evaluation.tables import (
    MOST_PRINTED,
    SIGNIFICANT,
    Overview,
    calibration_tables,
    difference_tables,
    estimate_tables,
    score_tables,
)
from jaxpf.files.writing import write_text
from jaxpf.measures.intervals import DECISIVE

NAME = "report.html"
_FILES = "results.csv (every run), summary.csv, curves.csv, differences.csv, figures/ (PNG)"
_INTERVALS = (
    "Values with 95% intervals in brackets. Runs are the independent units: frames and objects of "
    "a run add to the value, not to the certainty. Shares and rates are means over runs, with "
    "Clopper and Pearson's interval, of shares for as many trials as their spread is worth (Korn "
    "and Graubard 1998); below six runs it is too wide rather than too narrow. Errors and counts "
    "have no bound, so a few lost runs may dominate their mean: shown is the median over runs, "
    "with order statistics as its interval. Without brackets, the runs are too few: three are "
    "needed, of a median six."
)
_MEASURES = (
    "IoU is intersection over union. Success at IoU 0.5: the share of frames whose IoU exceeds "
    "0.5. Success AUC: the mean of that share over all thresholds from 0 to 1 (Wu, Lim and Yang "
    "2013). Smith2004's success and recovery ask for one shared pixel only, in every frame of a "
    "run or in its last one with truth, and do not say how well a box fits. Precision and recall "
    "are over the frames that share a pixel, the others over all frames with truth. The start "
    "frame never counts."
)
_DIFFERENCES = (
    "Differences are paired by run: equal seeds share their random numbers. Shares: the mean "
    "difference, with the interval of a mean; rates: with one that excludes 0 where McNemar's "
    "exact test does. Errors: the median difference, with order statistics. p belongs to the same "
    "interval: below 0.05 the 95% interval excludes 0. A star marks "
    f"p < {SIGNIFICANT} after Holm's correction over the comparisons in its column; of fewer than "
    f"{DECISIVE} runs nothing is marked. Points are percentage points."
)
_CALIBRATION = (
    "Calibration: how often the 50, 80 and 95% regions of x and of y, and those of a box's size "
    "(the square root of its area), cover the truth. A region is as wide as the particles' standard"
    " deviation and the model's declared error say (of points the slip, of learned boxes 0.3 in the"
    " logarithm of the size), as in tracks.csv. Only frames in which the object is tracked (a "
    "shared pixel) count, because no region covers a lost object. CRPS, in pixels, is small where "
    "intervals are calibrated and narrow (Gneiting and Raftery 2007); the log score is in "
    "summary.csv."
)
_CONFIDENCE = (
    "Confidence: share of the boxes on their object, by the confidence that was reported with "
    f"them. A box is on its object if their IoU is at least {ON_OBJECT:g}; all frames with "
    "truth count. The area under the curve is the probability that a box on its object has more "
    "confidence than one that is not, over all runs and objects. Off in silence: share of all "
    "frames with a box off its object that is not reported lost."
)


def write_report(overview: Overview) -> Path:
    """Write ``report.html`` and the figures into the evaluation's folder; return its path.

    Raises:
        InputError: a file cannot be written.
    """
    source = resources.files("jaxpf.evaluation").joinpath("report.html").read_text("utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = environment.from_string(source).render(_content(overview))
    path = overview.results.folder / NAME
    write_text(path, text.lstrip())
    return path


def _content(overview: Overview) -> dict[str, Any]:
    """The values of the template."""
    results, summaries, best = overview.results, overview.summaries, overview.ranked[:MOST_PRINTED]
    section: dict[str, Any] = {"figure": None, "tables": {}, "note": ""}
    differences = {"name": "differences", "title": "Paired differences", "note": _DIFFERENCES}
    sections = [section | differences | {"tables": difference_tables(overview)}]
    beside: dict[str, dict[str, Any]] = {
        "calibration": {"tables": calibration_tables(overview, best), "note": _CALIBRATION},
        "confidence": {"note": _CONFIDENCE},
    }
    for figure in write_figures(overview):
        about = {"name": figure.name, "title": figure.title, "figure": figure}
        sections.append(section | about | beside.get(figure.name, {}))
    settings = {name: results.settings.get(name) for name in ("asked", "versions")}
    return {
        "results": results,
        "conclusion": overview.conclusion if summaries else "",
        "best": summaries[overview.ranking[0]].name if overview.ranking else "",
        "remarks": overview.remarks,
        "estimates": estimate_tables(overview, best),
        "num_shown": len(best),
        "num_configurations": len(summaries),
        "scores": score_tables(overview, best),
        "notes": (_INTERVALS, _MEASURES),
        "sections": [each for each in sections if each["figure"] or each["tables"]],
        "settings": json.dumps(settings, indent=2, ensure_ascii=False),
        "files": _FILES,
    }
