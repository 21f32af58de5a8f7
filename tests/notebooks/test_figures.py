"""Figures of README and site are those of the tables and sentences that they are taken from.

What has no table by clip in the repository is compared with the page that README links to.
"""

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest

from jaxpf import contract, points
from jaxpf.likelihoods import DiscriminativeLikelihood
from jaxpf.measures import student_interval
from jaxpf.papers.judging import verdicts

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


def with_ends(values, digits):
    """A mean with Student's interval over clips, as the page prints it."""
    value, _, low, high = student_interval(np.array(list(values)))
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def gained(other, part="report"):
    """IoU of pretrained minus another tracker's, with its interval."""
    ours, theirs = by_clip("pretrained", "iou", part), by_clip(other, "iou", part)
    assert ours.keys() == theirs.keys()
    return with_ends([ours[clip] - theirs[clip] for clip in ours], 3)


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


def test_readme_stays_short():
    assert len((ROOT / "README.md").read_text().split()) <= 900


def test_readme_gives_the_figures_of_its_sources():
    of_readme = rows(section(read(ROOT / "README.md"), "Figures"))
    cows, flies = map(covered, points_reported().values())
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
            f"default {PRETRAINED['overlap']['default'].split()[0]}, "
            f"difference +{gained('default')}; "
            f"CSRT {PRETRAINED['overlap']['CSRT'].split()[0]}, difference +{gained('csrt')}; "
            f"off-object but not reported lost in {silent('pretrained')} of frames "
            f"(default {silent('default')})"
        ),
        "Do intervals cover a box's size?": f"in {percent(SIZE_COVERED)} of the tracked frames; "
        f"spanning 1/{least_factor()} to {least_factor()} times the size or more",
        "... and a keypoint's coordinates?": f"on the two clips in {cows}% and {flies}%, without "
        f"the {POINTS_LOST} reported lost; at least {math.floor(least_width())} pixels wide",
        "How fast is the bootstrap filter?": f"{SERIES['jaxpf']['one run, s']} s; "
        f"blackjax's SMC step takes {SERIES[BLACKJAX]['ratio']} times as long",
        "... and on a GPU?": f"{float(card['jaxpf']) / 1000:.2f} ms per observation for all runs; "
        f"blackjax's SMC step takes {beyond:.1f} times as long",
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
        ("width of the intervals of x and y, in sizes of the box", "width", 2),
        ("frames off the object (overlap below 0.1)", "off", 3),
        ("of all frames, off without a word", "silent", 3),
        ("of the frames on the object, said lost", "false_alarms", 3),
        ("confidence, area under the curve", "confidence_area", 2),
    ],
)
def test_the_table_of_pretrained_features_is_that_of_its_clips(row, column, digits):
    for tracker in ("default", "pretrained", "CSRT", "dlib"):
        values = by_clip(tracker.lower(), column).values()
        expected = with_ends(values, digits).replace("-0.000", "0.000") if values else "—"
        assert PRETRAINED[row][tracker].replace("-0.000", "0.000") == expected


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


def test_coverage_on_the_page_of_uncertainty():
    shown = rows(read(SITE / "uncertainty.md"))
    size = rows(section(DEFAULTS, "Size of boxes"), 1)["size (root of the area)"]["report, after"]
    parts = re.search(
        r"hold 0\.86 and 0\.99, and (\S+) and (\S+) on the test clips", prose(DEFAULTS)
    )
    contours = rows(section(DEFAULTS, "Contours on film"), 1)

    def of_contour(clip):
        return f"{100 * float(contours[clip]['now']):.0f}"  # the last of three columns "now"

    sources = {
        "size of a box, where it overlaps the truth by any area": percent(SIZE_COVERED).replace(
            "%", ""
        ),
        "size of a box, where the IoU is above 0.1": percent(size).replace("%", ""),
        f"x and y of keypoints, {POINTS_LOST} of which are reported lost": " and ".join(
            map(covered, points_reported().values())
        ),
        "x and y of parts": " and ".join(f"{100 * float(x):.0f}" for x in parts.groups()),
        "centre of closed contours": " and ".join(
            map(of_contour, ("segtrack2_girl", "davis_bmx-trees"))
        ),
        "centre of an open contour": of_contour("reported: worm_crossing_long"),
    }
    assert sources == {
        name: row["coverage, % [95% interval over clips]"] for name, row in shown.items()
    }


def test_sentences_on_the_page_of_uncertainty():
    text = prose(read(SITE / "uncertainty.md"))
    reported = points_reported().values()
    lost, near = (
        [f"{100 * float(row[name]):.0f}%" for row in reported]
        for name in ("large errors said lost", "near labels said lost")
    )
    x, y, width = (np.mean([*by_clip("default", name).values()]) for name in ("x", "y", "width"))
    for words in (
        f"covered the centre of a box in {percent(CENTRE_COVERED)} of these frames",
        f"from 1/{least_factor()} to {least_factor()} times the size, or wider",
        f"at least {math.floor(least_width())} pixels (an error of 8 pixels is included)",
        f"within about {least_width() / 2:.0f} pixels",
        f"On the four test clips that have both kinds, its AUC is {CONFIDENCE}.",
        f"on two test clips, {' and '.join(lost)} of the points with an error above 42 pixels were "
        "reported as lost",
        f"so were {' to '.join(sorted(near))} of the points near their labels",
        f"On 13 further clips, they covered x of the centre in {100 * x:.0f}% and y in "
        f"{100 * y:.0f}% of the tracked frames, and were {width:.2f} of the box wide. There the "
        f"box was off its object, without being reported lost, in {silent('default')} of all",
    ):
        assert words in text
    correlation = re.search(
        r"Errors of x ten frames apart are correlated by (\S+)", prose(DEFAULTS)
    )
    assert f"({correlation[1]} at a lag of ten frames)" in text


def test_confidence_on_the_page_of_uncertainty():
    shown = rows(section(read(SITE / "uncertainty.md"), "Confidence"))
    measured = rows(section(DEFAULTS, "Confidence of boxes"))
    for confidence, row in shown.items():
        share, frames = row["share on their object"], row["share of the frames"]
        assert measured[confidence]["report"] == f"{share} ({frames})"


def test_results_on_the_page_of_defaults():
    result = {name: row["result"] for name, row in rows(read(SITE / "choices.md")).items()}
    steps = rows(section(DEFAULTS, "Motion of boxes: long steps"))["0.6"]
    more = re.search(r"change it from (\S+) to (\S+) with 0\.6", prose(DEFAULTS)).groups()
    contours = rows(section(DEFAULTS, "Contours on film"))
    car = contours["davis_car-shadow"]
    riders = contours["segtrack2_bmx, two riders"]
    folded = rows(section(DEFAULTS, "Contours: each edge counts once"))["worm_crossing_long"]
    expected = {
        "300 particles for boxes": f"IoU {' and '.join(more)}",
        "process noise of a single box: long steps with standard deviation 0.6 of its size": (
            f"IoU {steps['21 clips of one object'].split(': ')[1]} over 0.18"
        ),
        "long steps of 0.18 for several boxes": (
            "with 0.6 the IoU is lower by "
            + negated(steps["4 clips of several"].split(": ")[1]).lstrip("+")
        ),
        "contours: noise as shares of the size": (
            f"share near the truth from {car['near before']} to {car['near']} on one clip, from "
            f"{riders['near before'].split(', ')[0]} to {riders['near'].split(', ')[0]} on another"
        ),
        "an edge counts once per contour": (
            "no folded contours; as published up to "
            f"{100 * float(folded['as published'].split(', ')[-1]):.0f}% on one clip"
        ),
    }
    assert {name: result[name] for name in expected} == expected


def test_earlier_figures_on_the_page_of_papers():
    text = prose(read(SITE / "papers.md"))

    def earlier(paper, key):
        (row,) = (row for row in verdicts.earlier(paper) if row["key"] == key)
        return row["figures"]

    *two, last = re.findall(r": (.*?\])", earlier("smith2004", "real_dps"))
    assert f"for three objects: {', '.join(two)} and {last})" in text

    def span(key):
        found = [float(each) for each in re.findall(r": (\S+) \[", earlier("gonzales2011", key))]
        return min(found), max(found)

    least, most = (100 * (each - 1) for each in span("time_of_equal_n"))
    assert f"takes {least:.0f} to {most:.0f}% longer than PS" in text
    least, most = span("time_of_twice_ps")
    assert f"SPS takes {least:.2f} to {most:.2f} times as long as PS with twice as many" in text
    figures = earlier("gonzales2011", "equal_time_twice_sorted")
    with_ten = sorted(-float(each) for each in re.findall(r"N = 10: (\S+) \[", figures))
    assert f"is {with_ten[0]:.0f} and {with_ten[1]:.0f}% larger with 10 particles" in text


def test_figures_of_questions_and_tasks():
    """Pages that repeat a figure of another page."""
    csrt = re.search(r"difference to CSRT is (\S+ \[.*?\])", HELD_OUT)[1]
    reported = points_reported()
    cows, flies = map(covered, reported.values())
    errors = sorted(f"{float(row['median error']):.0f}" for row in reported.values())
    confident = rows(section(DEFAULTS, "Confidence of boxes"))["0.8 to 1"]
    test, choosing = (confident[name].split()[0] for name in ("report", "choose"))
    more = re.search(r"change it from (\S+) to (\S+) with 0\.6", prose(DEFAULTS)).groups()
    for page, words in {
        "faq.md": (
            f"it was better on 13 test clips, by {gained('csrt')} in mean IoU. On the 15 clips "
            "used to choose how these features are used, the difference was "
            f"{gained('csrt', 'choose')}. With the default appearance, no difference was shown on "
            "11 test clips. On 44 clips, CSRT was better than an earlier default, by "
            + negated(csrt).lstrip("+")
        ),
        "howto/animals.md": (
            f"the median error was {' and '.join(errors)} pixels. Of the labelled keypoints, "
            f"{POINTS_LOST} were reported lost. For the others, the 95% intervals covered {cows}% "
            f"and {flies}% of the coordinates, and were at least {math.floor(least_width())} "
            "pixels wide"
        ),
        "howto/pretrained.md": (
            f"the mean IoU was {PRETRAINED['overlap']['pretrained'].split()[0]}, compared with "
            f"{PRETRAINED['overlap']['default'].split()[0]} by default, a difference of "
            f"+{gained('default')}"
        ),
        "choices.md": f"IoU +{gained('default')} on 13 test clips",
        "howto/lost.md": (
            f"{100 * float(test):.0f}% were on their object on eleven test clips, and "
            f"{100 * float(choosing):.0f}% on the clips"
        ),
        "howto/method.md": f"changed the IoU from {more[0]} to {more[1]}.",
        "../../CHANGELOG.md": f"from 1/{least_factor()} to {least_factor()} times the size",
    }.items():
        assert words in prose(read(SITE / page)), page


def test_dps_and_sps_differ_little_on_film():
    clips = rows(section(read(SITE / "development" / "sure.md"), COVERAGE), 1)
    both = [row for row in clips.values() if "," in row["DPS"]]
    dps, sps = ([int(row[name].split(", ")[1]) for row in both] for name in ("DPS", "SPS"))
    most = max(abs(a - b) for a, b in zip(dps, sps, strict=True))
    assert len(both) == 6
    faq = prose(read(SITE / "faq.md"))
    assert "On six clips of several objects" in faq
    assert f"by at most {most} percentage points" in faq


def test_boxes_on_a_clip_of_flies():
    def shown(tracker):
        iou, off = (by_clip(tracker, name)["sleap_fly_pair"] for name in ("iou", "silent"))
        return f"{iou:.2f}", f"{100 * off:.0f}%"

    (iou, many), (more, fewer) = shown("default"), shown("pretrained")
    words = (
        f"the mean IoU was {iou} by default and {more} with pretrained features. The box was off "
        f"its fly, without being reported lost, in {many} and {fewer} of the frames."
    )
    assert words in prose(read(SITE / "howto" / "animals.md"))


def test_where_pretrained_features_lose_more():
    pets = (by_clip(name, "iou")["pets09_first400"] for name in ("pretrained", "default"))
    words = "(IoU {:.3f}, by default {:.3f}, on one of the clips)".format(*pets)
    assert words in prose(read(SITE / "howto" / "pretrained.md"))


def test_points_by_a_network():
    near = rows(section(DEFAULTS, "A network's features, by name"))
    network, windows = (near[f"near: {name}"] for name in ("network", "windows, the default"))
    both = {
        clip: tuple(f"{100 * float(of[clip]):.0f}%" for of in (network, windows))
        for clip in ("cows", "flies", "worms")
    }
    words = "{} ({}) of the joints of cows, {} ({}) of flies, {} ({}) of points along two worms"
    shown = words.format(*both["cows"], *both["flies"], *both["worms"])
    assert shown in prose(read(SITE / "howto" / "pretrained.md"))
    result = rows(read(SITE / "choices.md"))["points by a pretrained network, on request"]["result"]
    lists = [[f"{float(of[clip]):.2f}" for clip in both] for of in (network, windows)]
    words = (
        "{}, {} and {} of the points are within 21 pixels of their labels "
        "({}, {} and {} with windows)"
    )
    assert words.format(*lists[0], *lists[1]) in result


def test_points_by_a_network_on_the_page_of_animals():
    network = rows(section(DEFAULTS, "A network's features, by name"))
    errors, lost = (
        [network[name][clip] for clip in ("cows", "flies")]
        for name in ("median error: network", "said lost: network")
    )
    shares = " and ".join(f"{100 * float(share):.0f}" for share in lost)
    windows, both = (
        [network[name][clip] for clip in ("cows", "flies")]
        for name in ("median error: windows", "said lost: windows")
    )
    (share,) = {f"{100 * float(each):.0f}" for each in both}
    words = (
        f"the median errors were {' and '.join(errors)} pixels, and {shares}% of the keypoints "
        f"were reported lost. In the same runs without it, the errors were {' and '.join(windows)} "
        f"pixels, and {share}% were reported lost."
    )
    assert words in prose(read(SITE / "howto" / "animals.md"))


def test_what_the_long_steps_gain_stands_beside_the_overlap():
    (former,) = re.findall(r"single object before, the overlap is (\S+):", prose(DEFAULTS))
    assert f"on these clips (before: IoU {former})" in prose(read(ROOT / "README.md"))
    assert f"{former} with the former noise" in prose(read(SITE / "choices.md"))
