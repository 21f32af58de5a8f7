"""Figures of README, and of tables that it links to, are those that they are taken from.

What has no table by clip in the repository is compared with the page that README links to.
"""

import math
import re

import numpy as np
import pytest
from stored_figures import (
    BLACKJAX,
    DEFAULTS,
    DIFFERENCE,
    GPU,
    HELD_OUT,
    POINTS_LOST,
    PRETRAINED,
    ROOT,
    SERIES,
    SITE,
    SIZE_COVERED,
    TEST_CLIPS,
    by_clip,
    covered,
    gained,
    least_factor,
    least_width,
    percent,
    points_reported,
    prose,
    read,
    rows,
    section,
    silent,
    with_ends,
)


def test_readme_stays_short():
    assert len((ROOT / "README.md").read_text().split()) <= 900


def test_readme_gives_the_figures_of_its_sources():
    of_readme = rows(section(read(ROOT / "README.md"), "Measurements"))
    cows, flies = map(covered, points_reported().values())
    errors = " and ".join(f"{float(row['median error']):.0f}" for row in points_reported().values())
    card = GPU["1000 x 1000"]
    beyond = float(card["blackjax 1.7.1"]) / float(card["jaxpf"])
    expected = {
        "How well are boxes tracked?": f"IoU {TEST_CLIPS['overlap']['jaxpf']}",
        "... compared with CSRT?": (
            f"CSRT {TEST_CLIPS['overlap']['CSRT'].split()[0]}, difference "
            f"{TEST_CLIPS[DIFFERENCE]['CSRT']}"
        ),
        "... with pretrained features?": (
            f"IoU {PRETRAINED['overlap']['pretrained'].split()[0]}; "
            f"minus default +{gained('default')}, minus CSRT +{gained('csrt')}; "
            f"on 15 tuning clips, minus CSRT +{gained('csrt', 'choose')}; "
            f"misplaced and not reported lost: {silent('pretrained')} of frames "
            f"(default {silent('default')}; earlier confidence)"
        ),
        "Do intervals cover a box's size?": f"in {percent(SIZE_COVERED)} of frames with any "
        f"overlap; at least 1/{least_factor()} to {least_factor()} times the size",
        "... and a keypoint's coordinates?": f"{cows}% and {flies}%, excluding "
        f"{POINTS_LOST} reported lost; at least {math.floor(least_width())} pixels wide; "
        f"median error {errors}",
        "How fast is the bootstrap filter?": f"{SERIES['jaxpf']['one run, s']} s; "
        f"blackjax's SMC step takes {SERIES[BLACKJAX]['ratio']} times that",
        "... and on a GPU?": f"{float(card['jaxpf']) / 1000:.2f} ms per observation for all runs; "
        f"blackjax's SMC step takes {beyond:.1f} times that",
    }
    answers = {question: row["answer"] for question, row in of_readme.items()}
    without_figures = answers.keys() - expected.keys()
    difference = re.search(r"difference to CSRT is (\S+ \[.*?\])", HELD_OUT)[1]
    protocol = of_readme["... compared with CSRT?"]["protocol"]
    assert f"earlier default: {difference} on [44 clips]" in protocol
    assert answers == expected | {question: answers[question] for question in without_figures}
    ours, former = by_clip("pretrained", "iou"), by_clip("default", "iou")
    better = sum(ours[clip] > former[clip] for clip in ours)
    assert f"better on {better} of {len(ours)} clips" in prose(read(ROOT / "README.md"))
    assert not any(re.search(r"\d", answers[question]) for question in without_figures)


@pytest.mark.parametrize(
    ("row", "column", "digits"),
    [
        ("overlap", "iou", 3),
        ("success: frames with an overlap above 0.5", "success", 2),
        ("x in the 95% interval, tracked frames", "x", 2),
        ("the same of y", "y", 2),
        ("the same of the size", "size", 2),
        ("width of the intervals of x and y, in sizes of the box (median)", "width", 2),
        ("frames off the object (overlap below 0.1)", "off", 3),
        ("of all frames, off without a word", "silent", 3),
        ("of the frames on the object, said lost", "false_alarms", 3),
        ("confidence, area under the curve", "confidence_area", 2),
    ],
)
def test_the_table_of_pretrained_features_is_that_of_its_clips(row, column, digits):
    for tracker in ("default", "pretrained", "CSRT", "dlib"):
        values = by_clip(tracker.lower(), column).values()
        expected = with_ends(values, digits, column != "width") if values else "—"
        assert PRETRAINED[row][tracker] == expected


def test_what_pretrained_features_gain_is_that_of_the_clips():
    row = PRETRAINED["overlap: pretrained minus the other, paired by clip"]
    for other in ("default", "CSRT", "dlib"):
        assert row[other].startswith(gained(other.lower()))
    chosen = prose(section(DEFAULTS, "Boxes by pretrained features"))
    means = (
        f"{np.mean(list(by_clip(tracker, 'iou', 'choose').values())):.3f}"
        for tracker in ("default", "pretrained", "csrt", "dlib")
    )
    words = "overlap {} for the default, {} pretrained, {} CSRT and {} dlib".format(*means)
    assert words in chosen
    assert f"minus default {gained('default', 'choose')}" in chosen
    assert f"minus CSRT {gained('csrt', 'choose')}" in chosen


def anchors(page):
    """Anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.*)", page.read_text(), re.M)
    return {re.sub(r"[^\w -]", "", each.lower()).replace(" ", "-") for each in headings}


def test_links_of_readme_lead_to_files_and_headings():
    for name, _, anchor in re.findall(
        r"\]\((?!https?:)([^)#]+)(#([^)]*))?\)", (ROOT / "README.md").read_text()
    ):
        assert (ROOT / name).is_file(), name
        assert not anchor or anchor in anchors(ROOT / name), f"{name}#{anchor}"


def ends(number):
    """Between which values a printed number lies before rounding."""
    half = 0.5 * 10.0 ** -len(number.partition(".")[2])
    return float(number) - half, float(number) + half


def may_be_ratio(printed, over, under):
    """Whether a printed ratio can be that of two rounded numbers."""
    (low, high), (least, most) = ends(over), ends(under)
    least_ratio, most_ratio = ends(printed)
    return low / most <= most_ratio and least_ratio <= high / least


def test_ratios_of_the_gpu_page_are_those_of_its_times():
    for row in GPU.values():
        assert may_be_ratio(row["jaxpf / by hand"], row["jaxpf"], row["by hand"]), row
        assert may_be_ratio(row["blackjax / jaxpf"], row["blackjax 1.7.1"], row["jaxpf"]), row
    assert not may_be_ratio("3.2", "379", "123")


@pytest.mark.parametrize("name", ["blackjax", "smcx", "particles", "cuthbert"])
def test_ratios_of_other_libraries_are_those_of_the_times(name):
    """To 6%: a median of ratios is not the ratio of medians."""
    page = prose(read(SITE / "state_space.md"))
    ours = re.search(rf"([\d.]+) s against {name}", page)[1]
    row = next(row for library, row in SERIES.items() if library.startswith(name))
    ratio = float(row["one run, s"]) / float(ours)
    assert float(row["ratio"]) == pytest.approx(ratio, rel=0.06)


@pytest.mark.parametrize("other", ["CSRT", "MIL", "KCF", "mean shift", "not moving"])
def test_paired_differences_are_those_of_the_means(other):
    """A mean of differences is a difference of means; each is rounded to three places."""
    ours, theirs = (float(TEST_CLIPS["overlap"][x].split()[0]) for x in ("jaxpf", other))
    assert float(TEST_CLIPS[DIFFERENCE][other].split()[0]) == pytest.approx(
        ours - theirs, abs=0.0016
    )


def test_the_difference_on_the_held_out_clips_is_that_of_the_means():
    ours, csrt = re.search(r"overlap is ([\d.]+); CSRT has ([\d.]+)", HELD_OUT).groups()
    difference = re.search(r"difference to CSRT is (\S+)", HELD_OUT)[1]
    assert float(difference) == pytest.approx(float(ours) - float(csrt), abs=0.0016)


def test_what_the_long_steps_gain_stands_beside_the_overlap():
    (former,) = re.findall(r"single object before, the overlap is (\S+):", prose(DEFAULTS))
    assert f"on these clips (before: {former})" in prose(read(ROOT / "README.md"))
    assert f"{former} with the former noise" in prose(read(SITE / "choices.md"))
