"""``jaxpf track contours`` and ``jaxpf contour learn``, on a small drawn clip."""

import json
import re
import tomllib

import cv2
import numpy as np
import pytest
from clips import write_contours, write_pictures
from command_line import jaxpf, refusal_of
from csv_rows import rows_of

WIDTH, HEIGHT, LENGTH = 120, 90, 6
#: Every run has these, so that the filter is compiled once.
FEW = ("-n", "60", "--set", "lines=8", "--set", "line_length=21", "--sigma", "3")


def wire(side, time):
    """Middle of a wire, ``[7, 2]``: two upright bows that move towards each other."""
    along = np.linspace(15, 75, 7)
    middle = 60 + side * (28 - 1.5 * time)
    return np.stack([middle + 4 * np.sin(along / 12), along], axis=1)


def picture(time, background=150, wires=(-1, 1)):
    noise = np.random.default_rng(time).normal(0, 2, (HEIGHT, WIDTH))
    grey = np.clip(background + noise, 0, 255).astype(np.uint8)
    for side in wires:
        points = np.round((wire(side, time) - 0.5) * 16).astype(np.int32)
        cv2.polylines(grey, [points], False, 40, 4, cv2.LINE_AA, 4)
    return grey


def contours(folder, closed=False, contours=None, **content):
    both = {"left": wire(-1, 0), "right": wire(1, 0)}
    return write_contours(folder / "contours.json", contours or both, closed, **content)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Nothing at all is seen in one frame."""
    empty = np.full((HEIGHT, WIDTH), 150, np.uint8)
    frames = (picture(time) if time != 3 else empty for time in range(LENGTH))
    return write_pictures(tmp_path_factory.mktemp("clip"), frames)


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    return contours(tmp_path_factory.mktemp("start"))


def track(clip, start, output, *options):
    return jaxpf("track", "contours", clip, "--contours", start, *FEW, "-o", output, *options)


@pytest.fixture(scope="module")
def whole_run(clip, start, tmp_path_factory):
    output = tmp_path_factory.mktemp("run") / "out"
    return track(clip, start, output), output


@pytest.mark.slow
def test_the_spread_is_drawn_around_the_contour(clip, start, tmp_path, monkeypatch):
    """A shift counts from the start contour, so it is no place in the frame."""
    drawn = []

    def record(picture, centres, spread, colours):
        drawn.append(np.array(centres))
        return picture

    monkeypatch.setattr("jaxpf.cli.tracking.overlay.draw_spreads", record)
    assert track(clip, start, tmp_path / "out", "--overlay").code == 0
    rows = [row for row in rows_of(tmp_path / "out" / "tracks.csv") if row["frame"] != "0"]
    places = [(float(row["x"]), float(row["y"])) for row in rows]
    np.testing.assert_allclose(np.concatenate(drawn), places, atol=1e-3)


@pytest.mark.slow
def test_wires_are_followed_also_through_a_frame_without_any_edge(whole_run):
    outcome, output = whole_run
    assert outcome.code == 0, outcome.err
    assert f"{LENGTH - 1} frames tracked" in outcome.out
    assert len(rows_of(output / "tracks.csv")) == 2 * LENGTH
    rows = rows_of(output / "outlines.csv")
    assert {row["kind"] for row in rows} == {"control", "outline"}
    for name, side in (("left", -1), ("right", 1)):
        last = [
            (float(row["x"]), float(row["y"]))
            for row in rows
            if (row["frame"], row["id"], row["kind"]) == (f"{LENGTH - 1}", name, "outline")
        ]
        gaps = np.linalg.norm(np.array(last)[:, None] - wire(side, LENGTH - 1), axis=-1)
        assert gaps.min(axis=0).mean() < 5


@pytest.mark.slow
def test_the_run_is_shown_and_can_be_repeated(whole_run, clip, start, tmp_path):
    _, output = whole_run
    assert {"overlay.mp4", "summary.json", "trajectories.png"} <= {p.name for p in output.iterdir()}
    errors = json.loads((output / "summary.json").read_text())["model_error"]
    slip = 0.1 * np.hypot(*np.ptp(wire(1, 0), axis=0)) / np.sqrt(2)
    assert errors == {name: pytest.approx([slip, slip, 0], abs=1e-3) for name in ("left", "right")}
    options = tomllib.loads((output / "run.toml").read_text())["track"]
    assert (options["target"], options["method"], options["exclusion"]) == (
        "contours",
        "ps",
        "wires",
    )
    again = jaxpf("track", clip, "--config", output / "run.toml", "-o", tmp_path / "again")
    assert again.code == 0, again.err
    assert (tmp_path / "again" / "tracks.csv").read_bytes() == (output / "tracks.csv").read_bytes()


LEAF = [[10, 20], [30, 18], [32, 40], [12, 38]]


@pytest.mark.slow
def test_three_opaque_contours_are_tracked_and_drawn(tmp_path):
    middles = dict(zip("abc", np.array([(30, 40), (60, 45), (92, 50)]), strict=True))
    frames = np.full((3, HEIGHT, WIDTH), 200, np.uint8)
    for time, grey in enumerate(frames):
        for (x, y), level in zip(middles.values(), (150, 100, 50), strict=True):
            cv2.ellipse(grey, (int(x) + time, int(y)), (18, 22), 0, 0, 360, level, -1)
    write_pictures(tmp_path, frames)
    corners = np.array([(0, -22), (18, 0), (0, 22), (-18, 0)]) * 1.3
    points = {name: corners + middle for name, middle in middles.items()}
    start = contours(tmp_path, closed=True, contours=points)
    outcome = track(
        tmp_path, start, tmp_path / "out", "--exclusion", "opaque", "--set", "clutter=1"
    )
    assert outcome.code == 0, outcome.err
    rows = rows_of(tmp_path / "out" / "outlines.csv")
    assert {row["id"] for row in rows} == {"a", "b", "c"}
    assert (tmp_path / "out" / "overlay.mp4").exists()


FIVE = {"closed": True, "contours": dict.fromkeys("abcde", LEAF)}


@pytest.mark.parametrize(
    ("content", "options", "named"),
    [
        (FIVE, "--exclusion opaque", "5 opaque"),
        ({"contours": {"far": [[200, 2], [203, 4], [200, 9], [209, 9]]}}, "", "'far'"),
        ({}, "--set wire_width=30 --set clutter=1", "width 30"),
        ({}, "--set edge_threshold=1000", "threshold"),
        ({}, "--set flip=0.1 --exclusion wires", "--set flip works only with --exclusion opaque"),
        ({}, "--shape-space translation --noise-bend 1", "--noise-bend 1"),
        pytest.param({}, "--method labelled", "log_joint", marks=pytest.mark.slow),
        ({}, "--truth gt.csv", "--truth"),
    ],
)
def test_what_does_not_go_together_is_one_sentence(clip, tmp_path, content, options, named):
    outcome = track(clip, contours(tmp_path, **content), tmp_path / "out", *options.split())
    assert outcome.code == 2
    *_, sentence = outcome.err.strip().splitlines()
    assert sentence.startswith("Error: ")
    assert named in sentence
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def annotated(tmp_path_factory):
    """Centrelines of both wires over 30 frames."""
    folder = tmp_path_factory.mktemp("annotated")
    rng = np.random.default_rng(0)
    lines = [
        f"{time},{side},{k},{x:.2f},{y:.2f}"
        for time in range(30)
        for side in (-1, 1)
        for k, (x, y) in enumerate(wire(side, time / 10) + rng.normal(0, 0.4, (7, 2)))
    ]
    (folder / "centrelines.csv").write_text("\n".join(["frame,id,k,x,y", *lines]) + "\n")
    return folder


@pytest.mark.slow
def test_what_is_learned_is_tracked_with(annotated, clip, start, tmp_path):
    learned = tmp_path / "learned.json"
    arguments = ("--turns", "8", "-d", "5", "--points", "7", "-o", learned)
    outcome = jaxpf("contour", "learn", annotated, *arguments)
    assert outcome.code == 0, outcome.err
    assert "60 contour(s) of 2 target(s) in 30 frame(s): 5 dimensions" in outcome.out
    assert "Dynamics of order 2" in outcome.out
    given = ("--learned", learned, "--frames", "2", "--no-overlay")
    outcome = track(clip, start, tmp_path / "out", *given)
    assert outcome.code == 0, outcome.err
    outcome = track(clip, start, tmp_path / "other", *given, "--shape-space", "affine")
    assert "affine was asked for and a learned one was given" in outcome.err


def test_masks_are_learned_from(tmp_path):
    masks = np.zeros((12, 60, 80), np.uint8)
    for number, mask in enumerate(masks):
        cv2.ellipse(mask, (30 + number, 30), (14 + number % 3, 9), 5 * number, 0, 360, 255, -1)
    write_pictures(tmp_path / "masks", masks)
    options = ("-d", "4", "--points", "8", "--order", "1", "-o", tmp_path / "learned.json")
    outcome = jaxpf("contour", "learn", tmp_path, *options)
    assert outcome.code == 0, outcome.err
    kept = float(re.search(r"hold them to ([\d.]+) pixels", outcome.out)[1])
    assert kept < 1.5


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ("--first 50", "50"),
        ("--last 0 -d 5", "5 dimensions"),
        ("--last 3 -d 5", "too few"),
        ("-d 1", "dimension 1"),
        ("--points 3", "3 control point"),
        ("--points 100000", "100000 control points"),
        ("-o none/learned.json", "'none/learned.json'"),
        ("-o old.json", "--overwrite"),
        ("--turns 8 --kind outlines", "outlines"),
    ],
)
def test_what_cannot_be_learned_is_refused(annotated, tmp_path, monkeypatch, options, named):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.json").touch()
    table = (annotated / "centrelines.csv").read_bytes()
    (tmp_path / "clip").mkdir()
    for kind in ("centrelines", "outlines"):
        (tmp_path / "clip" / f"{kind}.csv").write_bytes(table)
    given = ("--kind", "centrelines", "--points", "7", *options.split())
    assert named in refusal_of("contour", "learn", "clip", *given)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clip", "old.json"]
