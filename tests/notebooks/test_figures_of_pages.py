"""Figures of the site's pages are those of the tables and sentences that they are taken from."""

import math
import re

import numpy as np
from stored_figures import (
    CENTRE_COVERED,
    CONFIDENCE,
    COVERAGE,
    DEFAULTS,
    HELD_OUT,
    POINTS_LOST,
    PRETRAINED,
    SITE,
    SIZE_COVERED,
    by_clip,
    covered,
    gained,
    least_factor,
    least_width,
    negated,
    percent,
    points_reported,
    prose,
    read,
    rows,
    section,
    silent,
)

from jaxpf.papers.judging import verdicts


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
    area = PRETRAINED["confidence, area under the curve"]
    for words in (
        f"covered the centre of a box in {percent(CENTRE_COVERED)} of these frames",
        f"from 1/{least_factor()} to {least_factor()} times the size, or wider",
        f"at least {math.floor(least_width())} pixels (an error of 8 pixels is included)",
        f"within about {least_width() / 2:.0f} pixels",
        f"boxes on and off their object, the AUC of the confidence is {CONFIDENCE}, too uncertain",
        f"On nine of the 13 further clips it is {area['default']}.",
        f"on two test clips, {' and '.join(lost)} of the points with an error above 42 pixels were "
        "reported as lost",
        f"so were {' to '.join(sorted(near))} of the points near their labels",
        f"On 13 further clips, they covered x of the centre in {100 * x:.0f}% and y in "
        f"{100 * y:.0f}% of the tracked frames, and were {width:.2f} of the box wide. There, "
        "with the confidence of an earlier version, the box was off its object, without being "
        f"reported lost, in {silent('default')} of all",
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
    confident = rows(section(DEFAULTS, "Confidence of boxes"))["0.8 to 1"]
    test, choosing = (confident[name].split()[0] for name in ("report", "choose"))
    half = re.search(
        r"harder question: (\S+) of the boxes with .*? choosing clips, (\S+) on", prose(DEFAULTS)
    ).groups()
    more = re.search(r"change it from (\S+) to (\S+) with 0\.6", prose(DEFAULTS)).groups()
    for page, words in {
        "faq.md": (
            f"it was better on 13 test clips, by {gained('csrt')} in mean IoU (these clips had "
            "been used to choose earlier defaults, but nothing about these features). On the 15 "
            "clips used to choose how these features are used, the difference was "
            f"{gained('csrt', 'choose')}. With the default appearance, no difference was shown on "
            "11 test clips. On 44 clips, an earlier default was behind CSRT by "
            + negated(csrt).lstrip("+")
        ),
        "howto/pretrained.md": (
            f"the mean IoU was {PRETRAINED['overlap']['pretrained'].split()[0]}, compared with "
            f"{PRETRAINED['overlap']['default'].split()[0]} by default, a difference of "
            f"+{gained('default')}"
        ),
        "choices.md": f"IoU +{gained('default')} on 13 test clips",
        "../index.md": f"used to choose earlier defaults | +{gained('csrt')} |",
        "howto/lost.md": (
            f"{100 * float(test):.0f}% had an IoU of at least 0.1 with their object on eleven test "
            f"clips, but only {100 * float(half[1]):.0f}% one of at least 0.5 "
            f"({100 * float(choosing):.0f}% and {100 * float(half[0]):.0f}% on the clips"
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
        return f"{by_clip(tracker, 'iou')['sleap_fly_pair']:.2f}"

    many, fewer = (
        f"{100 * by_clip(name, 'silent')['sleap_fly_pair']:.0f}%"
        for name in ("default", "pretrained")
    )
    words = (
        f"the mean IoU was {shown('default')} by default and {shown('pretrained')} with pretrained "
        f"features. OpenCV's CSRT had {shown('csrt')} and dlib's correlation tracker "
        f"{shown('dlib')}. With an earlier confidence, the box was off its fly, without being "
        f"reported lost, in {many} of the frames by default and in {fewer} with pretrained features"
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


def test_points_on_the_page_of_animals():
    shown = rows(read(SITE / "howto" / "animals.md"), 1)
    other, network = "default, side by side", "`--appearance pretrained`, side by side"
    measured = rows(section(DEFAULTS, "A network's features, by name"))

    def both(name):
        return [measured[name][clip] for clip in ("cows", "flies")]

    def shares(name):
        return " and ".join(dict.fromkeys(f"{100 * float(x):.0f}" for x in both(name))) + "%"

    reported = points_reported()
    cows, flies = map(covered, reported.values())
    flow = re.search(
        r"Optical flow has (\S+) of the cows' labels near, and (\S+) of the flies'", prose(DEFAULTS)
    ).groups()
    ours, theirs = (
        [f"{100 * float(x):.0f}%" for x in values]
        for values in ([row["near"] for row in reported.values()], flow)
    )
    assert (
        f"By default {ours[0]} of the cow's labels and {ours[1]} of the flies' are within 21 "
        f"pixels; with optical flow (Lucas-Kanade) it is {theirs[0]} and {theirs[1]}."
    ) in prose(read(SITE / "howto" / "animals.md"))
    errors = sorted(f"{float(row['median error']):.0f}" for row in reported.values())
    assert shown["median error, pixels"] == {
        "cow and flies": "median error, pixels",
        "default": " and ".join(errors),
        other: " and ".join(both("median error: windows")),
        network: " and ".join(both("median error: network")),
    }
    assert shown["keypoints reported lost"] == {
        "cow and flies": "keypoints reported lost",
        "default": POINTS_LOST,
        other: shares("said lost: windows"),
        network: shares("said lost: network"),
    }
    covering = shown["coordinates of the others in 95% intervals"]["default"]
    assert covering == f"{cows}% and {flies}%"
    width = shown["width of these intervals, pixels"]["default"]
    assert width == f"at least {math.floor(least_width())}"
