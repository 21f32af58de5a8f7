"""``jaxpf track``: what it writes, and what it says to a user who made a mistake."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
import weakref

import cv2
import jax
import numpy as np
import pytest
from command_line import jaxpf

from jaxpf.files import tracks
from jaxpf.media.video import open_frames
from jaxpf.models import likelihoods
from jaxpf.streaming import stream
from jaxpf.targets import boxes as box_trackers

WIDTH, HEIGHT, LENGTH = 64, 48, 10
COLOURS = ((220, 30, 30), (30, 40, 220))
# Every successful run has these shapes, so that the filter is compiled once.
PARTICLES = ("-n", "60")
FROM_1 = np.array([1, 1, 0, 0])  # MOT files count pixels from 1
BOXES = ("--box", "6,8,12,16", "--box", "40,22,12,16")


def true_boxes(time):
    return np.array([[6 + 2 * time, 8 + time, 12, 16], [40 - time, 22 - time, 12, 16]])


def picture(time, noise=True):
    """Two coloured rectangles over grey."""
    frame = np.full((HEIGHT, WIDTH, 3), 110, np.uint8)
    if noise:
        frame = np.random.default_rng(time).integers(90, 130, frame.shape, dtype=np.uint8)
    for (x, y, w, h), colour in zip(true_boxes(time), COLOURS, strict=True):
        frame[y : y + h, x : x + w] = colour
    return frame


def write_images(folder, frames):
    folder.mkdir(parents=True)
    for number, frame in enumerate(frames):
        code = cv2.COLOR_RGBA2BGRA if frame.shape[-1] == 4 else cv2.COLOR_RGB2BGR
        cv2.imwrite(str(folder / f"{number}.png"), cv2.cvtColor(frame, code))
    return folder


def write_lossless_video(path, frames):
    fourcc = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, 25, (WIDTH, HEIGHT))
    for frame in frames:
        writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
    writer.release()
    return path


def write_truth(path, ids=(1, 2), last=LENGTH):
    rows = ["frame,id,x,y,w,h,occ"]
    for number in range(last):
        for identity, box in zip(ids, true_boxes(number), strict=True):
            rows.append(f"{number},{identity},{','.join(map(str, box))},0")
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the clip, as a video and as images, and its truth."""
    folder = tmp_path_factory.mktemp("cli")
    frames = [picture(number) for number in range(LENGTH)]
    write_lossless_video(folder / "clip.avi", frames)
    write_images(folder / "images", frames)
    write_truth(folder / "gt.csv")
    *rows, _ = (folder / "gt.csv").read_text().splitlines()
    (folder / "partial.csv").write_text("\n".join(rows))  # object 2 ends a frame earlier
    return folder


@pytest.fixture(scope="module")
def whole_run(place):
    """One run with everything on: its outcome and its folder."""
    output = place / "nested" / "whole"
    truth = ("--truth", place / "partial.csv")
    outcome = jaxpf("track", place / "clip.avi", *BOXES, *PARTICLES, *truth, "-o", output)
    assert outcome.code == 0, outcome.err
    return outcome, output


@pytest.fixture
def track(place, tmp_path, monkeypatch):
    """Track the clip into ``tmp_path/out``; a user's mistake must leave nothing there."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments, video=place / "clip.avi"):
        return jaxpf("track", video, *PARTICLES, "-o", tmp_path / "out", *arguments)

    return run


@pytest.fixture
def refuse(track, tmp_path):
    """Track, and get the one sentence of the refusal."""

    def run(*arguments, **options):
        outcome = track(*arguments, **options)
        assert outcome.code == 2
        assert outcome.out == ""
        assert not (tmp_path / "out").exists()
        *_, sentence = outcome.err.strip().splitlines()
        assert sentence.startswith("Error: ")
        assert "Traceback" not in outcome.err
        return sentence

    return run


def rows_of(output):
    return np.loadtxt(output / "tracks.csv", delimiter=",", ndmin=2)


def summary_of(output):
    return json.loads((output / "summary.json").read_text())


# What a run writes


def test_a_run_writes_these_files_and_no_others(whole_run):
    _, output = whole_run
    assert sorted(path.name for path in output.iterdir()) == [
        "diagnostics.csv",
        "diagnostics.png",
        "metrics.csv",
        "overlay.webm",
        "run.toml",
        "summary.json",
        "tracks.csv",
    ]


def test_tracks_are_mot_rows_whose_first_frame_is_the_given_boxes_counted_from_1(whole_run):
    rows = rows_of(whole_run[1])
    assert rows.shape == (2 * LENGTH, 10)
    np.testing.assert_array_equal(rows[:, 0], np.repeat(np.arange(1, LENGTH + 1), 2))
    np.testing.assert_array_equal(rows[:, 1], np.tile([1, 2], LENGTH))
    np.testing.assert_array_equal(rows[:2, 2:6], true_boxes(0) + FROM_1)
    np.testing.assert_array_equal(rows[:, 6], 1)


def test_tracks_follow_the_objects(whole_run):
    table = tracks.read_boxes(whole_run[1] / "tracks.csv")
    boxes = tracks.dense(table, [1, 2], LENGTH)
    truth = np.array([true_boxes(number) for number in range(LENGTH)])
    assert np.abs(boxes - truth).max() < 5


def test_the_overlay_shows_every_frame_from_the_start_frame_on(whole_run):
    overlay = open_frames(whole_run[1] / "overlay.webm")
    frames = list(overlay)
    assert len(frames) == LENGTH
    assert frames[0].shape == (HEIGHT, WIDTH, 3)
    assert overlay.fps == 25


def test_the_summary_holds_parameters_versions_seed_and_timing(whole_run):
    summary = summary_of(whole_run[1])
    assert summary["parameters"]["seed"] == 0
    assert summary["parameters"]["particles"] == 60
    assert summary["frames_tracked"] == LENGTH - 1
    assert summary["interrupted"] is False
    assert summary["error"] is None
    assert summary["lost_frames"] == {"1": [], "2": []}
    assert summary["seconds_first_frame"] > 0
    assert summary["frames_per_second"] > 0
    assert {"python", "jax", "jaxlib", "numpy", "jaxpf"} <= set(summary["versions"])


def test_the_diagnostics_are_a_plot_and_its_numbers(whole_run):
    _, output = whole_run
    plot = cv2.imread(str(output / "diagnostics.png"))
    assert min(plot.shape[:2]) > 300
    header, *rows = (output / "diagnostics.csv").read_text().splitlines()
    assert header == "frame,ess,log_evidence,uniqueness_1,uniqueness_2"
    numbers = np.array([row.split(",") for row in rows], float)
    np.testing.assert_array_equal(numbers[:, 0], np.arange(1, LENGTH))
    assert np.all((numbers[:, 1] >= 1) & (numbers[:, 1] <= 60))
    assert np.all((numbers[:, 3:] > 0) & (numbers[:, 3:] <= 1))


def test_truth_adds_a_table_over_the_frames_that_have_truth(whole_run):
    outcome, output = whole_run
    assert "Against the truth" in outcome.out
    assert "object 2" in outcome.out
    header, *rows = (output / "metrics.csv").read_text().splitlines()
    assert header.startswith("id,frames,tracked,precision,recall,overlap")
    assert [row.split(",")[:3] for row in rows] == [["1", "9", "1"], ["2", "8", "1"]]


def test_progress_tells_frames_per_second_and_the_time_left(whole_run):
    progress = whole_run[0].err
    assert "9/9" in progress
    assert "frames/s" in progress
    assert "left" in progress


def test_run_toml_repeats_the_run_bit_for_bit(whole_run, tmp_path, monkeypatch):
    _, output = whole_run
    monkeypatch.chdir(tmp_path)  # the file does not depend on where one stands
    outcome = jaxpf("track", "--config", output / "run.toml", "-o", "again")
    assert outcome.code == 0, outcome.err
    again = tmp_path / "again"
    for name in ("tracks.csv", "diagnostics.csv", "metrics.csv", "run.toml"):
        assert (again / name).read_bytes() == (output / name).read_bytes()


def test_run_toml_holds_every_option_that_shapes_the_result(whole_run):
    options = tomllib.loads((whole_run[1] / "run.toml").read_text())["track"]
    from jaxpf.cli.track import command

    unset = {"boxes", "ids", "parts_file", "frames", "order", "ess_threshold"}
    elsewhere = {"output", "overwrite", "config"}
    assert set(options) == {param.name for param in command.params} - unset - elsewhere


def test_another_seed_gives_other_tracks(whole_run, track, tmp_path):
    assert track(*BOXES, "--seed", 1, "--no-overlay").code == 0
    assert (tmp_path / "out" / "tracks.csv").read_bytes() != (
        whole_run[1] / "tracks.csv"
    ).read_bytes()
    assert not (tmp_path / "out" / "overlay.webm").exists()


def test_a_folder_of_images_gives_the_same_tracks_as_the_lossless_video(
    whole_run, track, place, tmp_path
):
    assert track(*BOXES, "--no-overlay", video=place / "images").code == 0
    assert (tmp_path / "out" / "tracks.csv").read_bytes() == (
        whole_run[1] / "tracks.csv"
    ).read_bytes()


def test_boxes_of_a_gt_file_and_of_a_mot_file_start_the_same_run(whole_run, track, place, tmp_path):
    expected = (whole_run[1] / "tracks.csv").read_bytes()
    for boxes in (place / "gt.csv", whole_run[1] / "tracks.csv"):
        outcome = track("--boxes", boxes, "--ids", "1,2", "--no-overlay", "--overwrite")
        assert outcome.code == 0, outcome.err
        assert (tmp_path / "out" / "tracks.csv").read_bytes() == expected


def test_ids_choose_the_objects_and_their_order(track, place, tmp_path):
    truth = write_truth(tmp_path / "named.csv", ids=(7, 3))
    outcome = track("--boxes", truth, "--ids", "3,7", "--frames", 1, "--no-overlay")
    assert outcome.code == 0, outcome.err
    rows = rows_of(tmp_path / "out")
    np.testing.assert_array_equal(rows[:, 1], [3, 7, 3, 7])
    np.testing.assert_array_equal(rows[0, 2:6], true_boxes(0)[1] + FROM_1)


def test_start_and_frames_bound_what_is_tracked(track, place, tmp_path):
    outcome = track("--boxes", place / "gt.csv", "--start", 3, "--frames", 2)
    assert outcome.code == 0, outcome.err
    rows = rows_of(tmp_path / "out")
    np.testing.assert_array_equal(rows[::2, 0], [4, 5, 6])  # frames 3, 4, 5 counted from 0
    np.testing.assert_array_equal(rows[:2, 2:6], true_boxes(3) + FROM_1)
    assert len(list(open_frames(tmp_path / "out" / "overlay.webm"))) == 3


@pytest.mark.parametrize("method", ["sir", "ps", "sps"])
def test_every_method_tracks(track, tmp_path, method):
    order = ("--order", "1,0") if method == "ps" else ()
    outcome = track(*BOXES, "--method", method, *order, "--frames", 2, "--no-overlay")
    assert outcome.code == 0, outcome.err
    np.testing.assert_array_equal(rows_of(tmp_path / "out")[:, 6], 1)


def test_names_with_spaces_and_any_letters_work(track, place, tmp_path):
    clip = tmp_path / "mein Vidéo 日本.avi"
    clip.write_bytes((place / "clip.avi").read_bytes())
    assert track(*BOXES, "--frames", 1, "-o", tmp_path / "a b" / "ü", video=clip).code == 0


def test_the_folder_is_named_after_the_video_by_default(place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = jaxpf("track", place / "clip.avi", *BOXES, *PARTICLES, "--frames", 1)
    assert outcome.code == 0
    assert (tmp_path / "jaxpf-clip" / "tracks.csv").exists()


@pytest.mark.parametrize("kind", ["grey", "alpha"])
def test_grey_and_alpha_frames_are_tracked(track, tmp_path, kind):
    frames = [picture(number) for number in range(2)]
    if kind == "grey":
        frames = [np.repeat(frame[..., :1], 3, axis=-1) for frame in frames]
    else:
        frames = [np.dstack([frame, np.full((HEIGHT, WIDTH), 77, np.uint8)]) for frame in frames]
    outcome = track(*BOXES, "--no-overlay", video=write_images(tmp_path / kind, frames))
    assert outcome.code == 0, outcome.err


def test_overwrite_leaves_no_file_of_the_earlier_run_and_every_other_file(track, place, tmp_path):
    assert track(*BOXES, "--frames", 1).code == 0
    for name in ("notes.txt", "metrics.csv"):
        (tmp_path / "out" / name).write_text("of before")
    assert track(*BOXES, "--frames", 1, "--no-overlay", "--overwrite").code == 0
    left = {path.name for path in (tmp_path / "out").iterdir()}
    assert "notes.txt" in left
    assert not left & {"overlay.webm", "metrics.csv"}


# What is reported rather than silent


def test_a_lost_object_is_reported_marked_and_listed(track, tmp_path):
    outcome = track(*BOXES, "--scale", "1e4,1e4,0", "--frames", 3)  # thrown off the frame
    assert outcome.code == 0
    assert "Lost: object 1 in 3 frame(s), first in frame 1." in outcome.err
    assert summary_of(tmp_path / "out")["lost_frames"]["1"] == [1, 2, 3]
    rows = rows_of(tmp_path / "out")
    np.testing.assert_array_equal(rows[:, 6], [1, 1, 0, 0, 0, 0, 0, 0])


def test_a_frame_that_no_particle_explains_is_left_out_and_counted(track, tmp_path):
    # Off the frame, 3e38 times the distance is more than float32 holds: -inf for everyone.
    scale = ("--scale", "1e4,1e4,0", "--sharpness", "3e38")
    outcome = track(*BOXES, *scale, "--frames", 2, "--no-overlay")
    assert outcome.code == 0
    assert "Warning: 2 frame(s) had no likelihood for any particle" in outcome.err
    assert summary_of(tmp_path / "out")["impossible_frames"] == 2
    assert cv2.imread(str(tmp_path / "out" / "diagnostics.png")) is not None


def test_likelihoods_that_are_no_number_are_counted(track, tmp_path):
    outcome = track(*BOXES, "--scale", "2e38,2e38,1", "--frames", 3, "--no-overlay")
    assert outcome.code == 0
    assert "likelihood(s) were not a number and counted as zero" in outcome.err
    assert summary_of(tmp_path / "out")["invalid_likelihoods"] > 0


def test_a_truncated_video_is_tracked_as_far_as_it_goes_with_a_note(track, place, tmp_path):
    data = (place / "clip.avi").read_bytes()
    (tmp_path / "cut.avi").write_bytes(data[: len(data) // 2])
    outcome = track(*BOXES, "--no-overlay", video=tmp_path / "cut.avi")
    assert outcome.code == 0
    assert re.search(r"Note: .*announces 10 frames.*it is cut off or damaged", outcome.err)
    summary = summary_of(tmp_path / "out")
    assert summary["video_truncated"] is True
    assert 0 < summary["frames_tracked"] < LENGTH - 1


def test_a_video_of_one_frame_says_that_nothing_was_tracked(track, tmp_path):
    clip = write_lossless_video(tmp_path / "one.avi", [picture(0)])
    outcome = track(*BOXES, video=clip)
    assert outcome.code == 0
    assert "No frame follows the start frame" in outcome.err
    assert rows_of(tmp_path / "out").shape == (2, 10)
    assert summary_of(tmp_path / "out")["frames_tracked"] == 0


def test_a_fault_of_the_video_on_the_way_keeps_what_was_tracked(track, tmp_path):
    frames = [picture(0), picture(1), picture(2)[:40]]
    outcome = track(*BOXES, video=write_images(tmp_path / "mixed", frames))
    assert outcome.code == 2
    assert "mixes image sizes: '0.png' is 64x48 but '2.png' is 64x40" in outcome.err
    assert rows_of(tmp_path / "out").shape == (4, 10)
    assert len(list(open_frames(tmp_path / "out" / "overlay.webm"))) == 2
    assert "mixes image sizes" in summary_of(tmp_path / "out")["error"]


def test_a_disk_that_fills_up_is_one_sentence_and_keeps_whole_lines(track, tmp_path, monkeypatch):
    from jaxpf.cli.recorder import Recorder

    diagnose = Recorder._diagnose

    class Full:
        def __init__(self, file):
            self.file = file
            self.tell, self.truncate, self.seek = file.tell, file.truncate, file.seek

        def write(self, data):
            self.file.write(data[:3])
            raise OSError(28, "No space left on device")

    def fails_at_the_third(self, fields):
        if fields[0] == "3":
            self.diagnostics = Full(self.diagnostics)
        diagnose(self, fields)

    monkeypatch.setattr(Recorder, "_diagnose", fails_at_the_third)
    outcome = track(*BOXES)
    assert outcome.code == 2
    assert re.search(r"cannot write '.*diagnostics.csv': no space left", outcome.err)
    assert (tmp_path / "out" / "diagnostics.csv").read_text().count("\n") == 3
    assert summary_of(tmp_path / "out")["frames_tracked"] == 2


# Ctrl-C


# A program that is started in the background inherits an ignored Ctrl-C.
PROGRAM = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from jaxpf.cli import main
main(sys.argv[1:])
"""


def ended_by_interrupt(output, arguments):
    """Start the program, interrupt it once it tracks, and wait for its end."""
    command = [sys.executable, "-c", PROGRAM, "track", *map(str, arguments), "-o", str(output)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        deadline = time.monotonic() + 120
        while process.poll() is None and time.monotonic() < deadline:
            with contextlib.suppress(FileNotFoundError):
                if (output / "tracks.csv").read_text().count("\n") > 10:
                    break
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        return process.wait(60), process.stderr.read()
    finally:
        process.kill()
        process.stderr.close()


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_leaves_valid_tracks_and_a_playable_video(whole_run, tmp_path):
    frames = (picture(number % LENGTH, noise=False) for number in range(1000))
    clip = write_lossless_video(tmp_path / "long.avi", frames)
    output = tmp_path / "out"
    code, errors = ended_by_interrupt(output, [clip, *BOXES, *PARTICLES])
    assert code == 130
    assert errors.strip().endswith("Interrupted.")
    assert "Traceback" not in errors
    summary = summary_of(output)
    assert summary["interrupted"] is True
    assert 3 < summary["frames_tracked"] < 999
    table = tracks.read_boxes(output / "tracks.csv")
    shown = len(list(open_frames(output / "overlay.webm")))
    assert abs(len(table) / 2 - 1 - summary["frames_tracked"]) <= 1
    assert abs(shown - 1 - summary["frames_tracked"]) <= 1
    assert (output / "diagnostics.png").exists()


def test_ctrl_c_before_the_first_frame_leaves_no_folder(track, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("jaxpf.streaming.stream", interrupted)
    outcome = track(*BOXES)
    assert outcome.code == 130
    assert not (tmp_path / "out").exists()


# Bad input


def test_a_missing_video_is_named_with_the_current_folder(refuse, tmp_path):
    sentence = refuse(*BOXES, video="nowhere.mp4")
    assert "there is no video or folder at 'nowhere.mp4'" in sentence
    assert str(tmp_path) in sentence


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("empty.mp4", b"", "is empty"),
        ("junk.mp4", bytes(range(256)) * 20, "is not a video that OpenCV can read"),
        ("stub.avi", b"RIFF\x00\x00\x00\x00AVI LIST" + bytes(99), "begins as AVI but is cut off"),
        ("text.mp4", b"hello\n" * 50, "is a text file"),
    ],
)
def test_a_file_that_is_no_video_is_refused(refuse, tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    assert message in refuse(*BOXES, video=tmp_path / name)


def test_a_folder_without_images_is_refused(refuse, tmp_path):
    (tmp_path / "none").mkdir()
    assert "holds no images" in refuse(*BOXES, video=tmp_path / "none")


def test_sizes_that_differ_at_once_leave_no_folder(refuse, tmp_path):
    mixed = write_images(tmp_path / "mixed", [picture(0), picture(1)[:40]])
    assert "mixes image sizes" in refuse(*BOXES, video=mixed)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no start box: give --box x,y,w,h"),
        (("--box", "1,2,3"), "box '1,2,3' has 3 number(s) instead of 4"),
        (("--box", "1,2,a,4"), "box '1,2,a,4' holds 'a', which is not a number"),
        (("--box", "1,2,nan,4"), "holds a value that is not finite"),
        (("--box", "1,2,0,4"), "has the size 0 x 4; both must be positive"),
        (("--box", "64,2,5,5"), "the box of object 1 (64,2,5,5) lies outside the 64x48 frame"),
        (("--box", "1,2,9,1"), "the box of object 1 is 9.0 pixels wide and 1.0 high"),
        ((*BOXES, "--boxes", "gt.csv"), "--box and --boxes were both given"),
        ((*BOXES, "--ids", "1"), "--ids names objects of a CSV file"),
        ((*BOXES, "--start", "-1"), "--start -1 must be at least 0"),
        ((*BOXES, "--start", "10"), "start frame 10 is past the end"),
        ((*BOXES, "--start", "x"), "Invalid value for '--start'"),
        ((*BOXES, "--frames", "0"), "--frames 0 must be at least 1"),
        ((*BOXES, "-n", "0"), "--particles 0 must be at least 1"),
        ((*BOXES, "-n", "1"), "--particles 1 is fewer than the 2 components of dps"),
        ((*BOXES, "-n", "1" + 12 * "0"), "must be below 2147483648"),
        ((*BOXES, "--method", "foo"), "'foo' is unknown; choose one of sir, ps, dps, sps"),
        ((*BOXES, "--swap", "foo"), "choose one of combinatorial, none, random, sorted"),
        ((*BOXES, "--resampling", "foo"), "choose one of systematic, stratified"),
        ((*BOXES, "--likelihood", "foo"), "choose one of auto, integral, sampled"),
        ((*BOXES, "--codec", "foo"), "choose one of vp9, vp8"),
        ((*BOXES, "--order", "1,0"), "method 'dps' has none; add --method ps"),
        ((*BOXES, "--method", "ps", "--order", "0,0"), "--order 0,0 is not a permutation"),
        ((*BOXES, "--method", "ps", "--order", "1"), "name each of 0 to 1 once"),
        ((*BOXES, "--method", "ps", "--order", "0,x"), "'0,x' is not whole numbers"),
        ((*BOXES, "--seed", "-1"), "--seed -1 must be between 0 and 4294967295"),
        ((*BOXES, "--seed", "4294967296"), "must be between 0 and 4294967295"),
        ((*BOXES, "--sharpness", "nan"), "--sharpness nan must be positive and finite"),
        ((*BOXES, "--sharpness", "0"), "--sharpness 0.0 must be positive and finite"),
        ((*BOXES, "--parts", "0"), "--parts 0 must be at least 1"),
        ((*BOXES, "--parts", "17"), "the box of object 1 is 12.0 pixels wide and 16.0 high"),
        ((*BOXES, "--scale", "1,2"), "holds 2 number(s); give 3 of them"),
        ((*BOXES, "--scale", "1,2,-1"), "must be three finite numbers >= 0"),
        ((*BOXES, "--ess-threshold", "2"), "must be a share between 0 and 1"),
        ((*BOXES, "--bogus"), "No such option"),
        ((*BOXES, "more"), "Got unexpected extra argument"),
    ],
)
def test_a_bad_option_is_one_sentence_that_names_the_value(refuse, arguments, message):
    assert message in refuse(*arguments)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("frame,id,x,y,w,h\n0,1,6,8,12,16\n0,2,a,3,4,5\n", "line 3 of 'boxes.csv' has 'a'"),
        ("1,1,7,9,12,16,1\n1,2,7,9,12\n", "line 2 of 'boxes.csv' has 5 column(s)"),
        ("frame,id,x,y,w,h\n0,1,6,8,0,16\n", "line 2 of 'boxes.csv' has a box of zero size"),
        ("frame,id,x,y,w,h\n3,1,6,8,9,16\n", "has no box in frame 0; choose a start frame among 3"),
        ("id;x;y\n", "line 1 of 'boxes.csv' has an unknown header"),
        ("", "'boxes.csv' is empty"),
    ],
)
def test_a_bad_file_of_boxes_is_refused_by_its_line(refuse, tmp_path, content, message):
    (tmp_path / "boxes.csv").write_text(content)
    assert message in refuse("--boxes", "boxes.csv")


def test_an_unknown_id_is_refused_with_those_that_exist(refuse, place):
    sentence = refuse("--boxes", place / "gt.csv", "--ids", "1,7")
    assert "id 7 has no box in frame 0" in sentence
    assert "the ids there are 1, 2" in sentence


def test_truth_that_says_nothing_about_the_run_is_refused_before_tracking(refuse, tmp_path):
    others = write_truth(tmp_path / "others.csv", ids=(8, 9))
    assert "has no box of object 1, 2, which this run tracks" in refuse(*BOXES, "--truth", others)
    early = write_truth(tmp_path / "early.csv", last=1)
    assert "has no box of object 1, 2 in the frames from 1" in refuse(*BOXES, "--truth", early)
    assert "there is no file of boxes at" in refuse(*BOXES, "--truth", "nowhere.csv")


def test_an_output_folder_in_use_is_refused_and_stays_as_it_is(track, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "tracks.csv").write_text("precious")
    outcome = track(*BOXES)
    assert outcome.code == 2
    assert "is not empty (it holds 'tracks.csv'); choose another --output" in outcome.err
    assert (tmp_path / "out" / "tracks.csv").read_text() == "precious"


def test_an_output_folder_that_cannot_be_made_is_refused(place, tmp_path):
    (tmp_path / "file").write_text("")
    run = ("track", place / "clip.avi", *BOXES, *PARTICLES)
    outcome = jaxpf(*run, "-o", tmp_path / "file" / "out")
    assert outcome.code == 2
    assert "cannot create the output folder" in outcome.err
    outcome = jaxpf(*run, "-o", tmp_path / "file")
    assert outcome.code == 2
    assert "is a file; choose another --output" in outcome.err


def test_results_are_never_mixed_with_the_frames_they_come_from(place, tmp_path):
    images = write_images(tmp_path / "images", [picture(0), picture(1)])
    outcome = jaxpf("track", images, *BOXES, *PARTICLES, "-o", images, "--overwrite")
    assert outcome.code == 2
    assert "would mix the results with the video" in outcome.err
    assert sorted(path.name for path in images.iterdir()) == ["0.png", "1.png"]

    (tmp_path / "earlier").mkdir()
    clip = tmp_path / "earlier" / "overlay.webm"
    clip.write_bytes((place / "clip.avi").read_bytes())
    outcome = jaxpf("track", clip, *BOXES, *PARTICLES, "-o", clip.parent, "--overwrite")
    assert outcome.code == 2
    assert clip.stat().st_size > 0


# Agreement with the library, and memory


def test_the_command_names_the_choices_that_the_library_has():
    from jaxpf.cli import track as module
    from jaxpf.filters import resampling
    from jaxpf.filters.partitioned import ordering
    from jaxpf.targets import boxes

    assert set(module._METHODS) == set(boxes.METHODS)
    assert set(module._SCHEMES) == set(resampling.SCHEMES)
    assert set(module._SWAPS) == set(ordering.SWAPS)


def test_frames_that_were_tracked_are_not_kept():
    references, most = [], 0

    def frames():
        nonlocal most
        for number in range(2 * LENGTH):
            frame = picture(number % LENGTH)
            references.append(weakref.ref(frame))
            most = max(most, sum(reference() is not None for reference in references))
            yield frame

    start = true_boxes(0)
    tracker = box_trackers.box_tracker(
        likelihoods.histogram(picture(0), start, num_particles=60),
        start,
        box_trackers.ordering_of("dps", 2),
        num_particles=60,
    )
    for tracked in stream(tracker, jax.random.key(0), frames()):
        assert tracked.frame.shape == (HEIGHT, WIDTH, 3)
    assert most <= 3
