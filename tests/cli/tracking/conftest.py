"""The clip, and the command on it."""

import functools

import numpy as np
import pytest
from clips import write_pictures
from command_line import jaxpf, refusal_of
from films import write_film
from small_video import (
    BOXES,
    LENGTH,
    PARTICLES,
    STAMPS,
    picture,
    true_boxes,
    write_lossless_video,
    write_truth,
)

from jaxpf.detections.files import write_detections

COLOUR = ("--appearance", "colour")
THROWN_OFF = (*COLOUR, "--noise-pixels", "1e4,1e4,0")
#: Whole runs that tests look at: video and options.  One size of the filter, and two appearances:
#: it is compiled twice.
RUNS = {
    "whole": ("clip.avi", *BOXES, "--truth", "partial.csv"),
    "film": ("film.mkv", *BOXES),
    "deep": ("deep", *BOXES, "--range", "100,610", "--fps", 10),
    "lost": ("clip.avi", *BOXES, *THROWN_OFF, "--frames", 3),
    # Off the frame, 3e38 times the distance is more than float32 holds: -inf for everyone.
    "impossible": (
        "clip.avi",
        *BOXES,
        *THROWN_OFF,
        "--sharpness",
        "3e38",
        "--frames",
        2,
        "--no-overlay",
    ),
    "no number": (
        *("clip.avi", *BOXES, *COLOUR, "--noise-pixels", "2e38,2e38,1"),
        *("--frames", 3, "--no-overlay"),
    ),
    "cut": ("cut.avi", *BOXES, *COLOUR, "--no-overlay"),
    "detected": (*("clip.avi", "--detections", "det.txt", "--min-hits", "2", "--capacity", "2"),),
}


def gone(number):
    """A picture without the second rectangle after frame 4; nothing leaves the picture."""
    frame = picture(number)
    if number > 4:
        x, y, w, h = true_boxes(number)[1]
        frame[y : y + h, x : x + w] = frame[-1, -1]
    return frame


@pytest.fixture(scope="session")
def place(tmp_path_factory):
    """A folder with the clip, as videos and as images, its truth and detections."""
    folder = tmp_path_factory.mktemp("cli")
    frames = [picture(number) for number in range(LENGTH)]
    clip = write_lossless_video(folder / "clip.avi", frames).read_bytes()
    (folder / "cut.avi").write_bytes(clip[: len(clip) // 2])
    write_film(folder / "film.mkv", map(gone, range(LENGTH)), "ffv1", "bgr0", None, 1000, STAMPS)
    write_pictures(folder / "images", frames)
    write_pictures(folder / "deep", [100 + 2 * frame.astype("u2") for frame in frames])
    write_truth(folder / "gt.csv")
    *rows, _ = (folder / "gt.csv").read_text().splitlines()
    (folder / "partial.csv").write_text("\n".join(rows))  # object 2 ends a frame earlier
    detections = [true_boxes(time).astype(float) for time in range(LENGTH)]
    detections[4] = np.vstack([detections[4], [[1, 30, 12, 16]]])  # something else
    write_detections(folder / "det.txt", detections)
    return folder


@pytest.fixture(scope="session")
def run_of(place):
    """A function that gives the outcome and the folder of a whole run, which is made once."""

    @functools.cache
    def run(name):
        output = place / "runs" / name
        words = [place / word if (place / str(word)).is_file() else word for word in RUNS[name]]
        words[0] = place / words[0]
        outcome = jaxpf("track", *words, *PARTICLES, "-o", output)
        assert outcome.code == 0, outcome.err
        return outcome, output

    return run


@pytest.fixture
def whole_run(run_of):
    """One run with everything on: its outcome and its folder."""
    return run_of("whole")


@pytest.fixture
def track(place, tmp_path, monkeypatch):
    """Track the clip into ``tmp_path/out``."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments, video=place / "clip.avi"):
        return jaxpf("track", video, *PARTICLES, "-o", tmp_path / "out", *arguments)

    return run


@pytest.fixture
def refuse(place, tmp_path, monkeypatch):
    """Track, and get the one sentence of the refusal; nothing may be left behind."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments, video=place / "clip.avi"):
        sentence = refusal_of("track", video, *PARTICLES, "-o", tmp_path / "out", *arguments)
        assert not (tmp_path / "out").exists()
        return sentence

    return run
