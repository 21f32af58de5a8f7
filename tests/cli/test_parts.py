"""``jaxpf track parts``: articulated objects from the command line."""

import json
import tomllib

import numpy as np
import pytest
from clips import write_parts, write_pictures
from command_line import assert_same, built_by_track, jaxpf, refusal_of
from csv_rows import rows_of

import scenes
from jaxpf.shapes.rectangles import corners_from_poses

NAMES = ("body", "left1", "right1", "left2", "right2")
LENGTH = 12
# Every successful run has these shapes, so that the filter is compiled once.
PARTICLES = ("-n", "60")


@pytest.fixture(scope="module")
def scene():
    return scenes.make("articulated", 4, num_parts=5, num_frames=LENGTH)


@pytest.fixture(scope="module")
def clip(scene, tmp_path_factory):
    return write_pictures(tmp_path_factory.mktemp("clip"), scene.frames)


def rows_of_start(scene):
    for part, (x, y, theta) in enumerate(scene.extras["poses"][0]):
        parent = scene.extras["parents"][part]
        on = NAMES[parent] if parent >= 0 else ""
        yield NAMES[part], on, x, y, *scene.sizes[part], np.degrees(theta)


@pytest.fixture(scope="module")
def parts(scene, tmp_path_factory):
    return write_parts(tmp_path_factory.mktemp("parts") / "parts.csv", *rows_of_start(scene))


@pytest.fixture
def track(clip, parts, tmp_path):
    """Track the clip's parts into ``tmp_path/out``."""

    def run(*options, video=clip, file=parts):
        given = ("--parts", file, *PARTICLES, "-o", tmp_path / "out", *options)
        return jaxpf("track", "parts", video, *given)

    return run


@pytest.fixture(scope="module")
def whole_run(clip, parts, tmp_path_factory):
    output = tmp_path_factory.mktemp("run") / "out"
    given = ("--parts", parts, *PARTICLES, "-o", output)
    return jaxpf("track", "parts", clip, *given), output


def mean_corner_distance(scene, output):
    poses = np.zeros((LENGTH, len(NAMES), 3))
    for row in rows_of(output / "tracks.csv"):
        pose = float(row["x"]), float(row["y"]), np.radians(float(row["angle"]))
        poses[int(row["frame"]), NAMES.index(row["id"])] = pose
    corners = corners_from_poses(poses, scene.sizes)
    return float(np.mean(np.linalg.norm(corners - scene.extras["corners"], axis=-1)))


def test_parts_are_followed_and_every_file_is_written(scene, whole_run):
    outcome, output = whole_run
    assert outcome.code == 0, outcome.err
    assert f"{LENGTH - 1} frames tracked" in outcome.out
    assert {path.name for path in output.iterdir()} == {
        "tracks.csv", "overlay.mp4", "diagnostics.csv", "summary.json",
        "run.toml", "trajectories.png",
    }  # fmt: skip
    header, *rows = (output / "tracks.csv").read_text().splitlines()
    assert header == (
        "frame,time,id,x,y,w,h,angle,x_2.5,x_97.5,y_2.5,y_97.5,angle_2.5,angle_97.5,"
        "speed,speed_2.5,speed_97.5,confidence,lost"
    )
    assert len(rows) == LENGTH * len(NAMES)
    assert mean_corner_distance(scene, output) < 4


@pytest.mark.slow
def test_two_bodies_are_followed_in_one_run(scene, track, tmp_path_factory, tmp_path):
    """One above the other: the first is the scene's object, the second moves like its mirror."""
    height, width = scene.frames.shape[1:3]
    both = [np.concatenate([frame, frame[:, ::-1]]) for frame in scene.frames]
    film = write_pictures(tmp_path_factory.mktemp("film"), both)
    poses, rows = scene.extras["poses"], list(rows_of_start(scene))
    for name, on, x, y, w, h, angle in list(rows):
        parent = f"second {on}" if on else ""
        rows.append((f"second {name}", parent, width - x, y + height, w, h, -angle))
    file = write_parts(tmp_path / "parts.csv", *rows)
    outcome = track(video=film, file=file)
    assert outcome.code == 0, outcome.err
    last = [
        row for row in rows_of(tmp_path / "out" / "tracks.csv") if int(row["frame"]) == LENGTH - 1
    ]
    found = {row["id"]: (float(row["x"]), float(row["y"])) for row in last}
    assert len(found) == 2 * len(NAMES)
    mirrored = poses[-1, :, :2] * (-1, 1) + (width, height)
    for name, first, second in zip(NAMES, poses[-1, :, :2], mirrored, strict=True):
        assert np.hypot(*(found[name] - first)) < 6
        assert np.hypot(*(found[f"second {name}"] - second)) < 6


def test_summary_and_configuration_name_the_parts_and_repeat_the_run(whole_run, clip, parts):
    _, output = whole_run
    summary = json.loads((output / "summary.json").read_text())
    assert summary["ids"] == list(NAMES)
    assert summary["likelihood_method"] == "sampled"
    assert summary["frames_outside"] == {name: [] for name in NAMES}
    options = tomllib.loads((output / "run.toml").read_text())["track"]
    found = [options[name] for name in ("method", "noise_pixels", "parts")]
    assert found == ["sps", [3, 3, 3.5], str(parts.resolve())]
    start, tracker = built_by_track("parts", clip, "--parts", parts, *PARTICLES)
    same, again = built_by_track("parts", clip, "--config", output / "run.toml")
    np.testing.assert_array_equal(same.ids, start.ids)
    assert_same(again, tracker)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        "--method ps --set order=1,3,2,5,4",
        "--set swap=sorted",
        "--dynamics absolute",
        "--set likelihood=patch",
    ],
)
def test_other_ways_to_track_parts(scene, track, tmp_path, options):
    sharpness = ("--sharpness", 20) if "patch" in options else ()
    outcome = track("--no-overlay", *options.split(), *sharpness)
    assert outcome.code == 0, outcome.err
    assert mean_corner_distance(scene, tmp_path / "out") < 6
    method = json.loads((tmp_path / "out" / "summary.json").read_text())["likelihood_method"]
    assert method == ("patch" if "patch" in options else "sampled")


def test_a_configuration_of_parts_is_of_no_use_to_boxes(whole_run, clip, tmp_path):
    config = ("--config", whole_run[1] / "run.toml", "--box", "900,900,5,5", "-o", tmp_path / "o")
    assert "No such option '--box'" in refusal_of("track", clip, *config)
    assert "run.toml' is not for boxes" in refusal_of("track", "boxes", clip, *config)


@pytest.mark.parametrize(
    ("options", "line", "named"),
    [
        ("--box 1,2,3,4", "", "--box"),
        ("--truth gt.csv", "", "--truth"),
        ("--method ps --set order=2,1,3,4,5", "", "part 2"),
        ("--set likelihood=patch --set bands=2", "", "--set bands works only with"),
        ("--dynamics absolute --noise-joints 1,1,2", "", "--noise-joints"),
        ("", "tail,body,1000,10,5,5,0", "'tail' is at (1000, 10)"),
        ("", "tail,body,10,10,0.4,5,0", "'tail' is 0.4"),
    ],
)
def test_what_cannot_be_tracked_is_one_sentence(track, parts, tmp_path, options, line, named):
    file = tmp_path / "parts.csv"
    file.write_text(f"{parts.read_text()}{line}\n")
    outcome = track(*options.split(), file=file)
    assert outcome.code == 2
    assert outcome.err.startswith("Error: ")
    assert named in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
