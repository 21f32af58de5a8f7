"""Trackers from the public factories are those of the command line."""

import dataclasses
import runpy
from pathlib import Path

import cv2
import jax
import numpy as np
import pytest
from clips import write_contours, write_parts, write_pictures
from command_line import assert_same, built_by_track, jaxpf as command

import jaxpf
from jaxpf import InputError

PROGRAM = Path(__file__).parents[1] / "house" / "ten_lines.py"
BOXES = [[120, 80, 40, 90], [300, 85, 42, 88]]
FRAME = cv2.resize(np.random.default_rng(0).integers(0, 255, (30, 48, 3), np.uint8), (384, 240))


@pytest.fixture
def clip(tmp_path, monkeypatch):
    """A textured picture that moves by a pixel per frame."""
    monkeypatch.chdir(tmp_path)
    with jaxpf.media.VideoWriter("clip.mp4", 384, 240, 25) as video:
        for time in range(4):
            video.write(np.roll(FRAME, time, axis=1))
    return tmp_path


@pytest.mark.slow
@pytest.mark.always
def test_ten_lines_track_as_the_command_line_does(clip):
    code = [line for line in PROGRAM.read_text().splitlines() if line.strip()]
    assert len(code) <= 1 + 10  # its docstring, and the program
    made = runpy.run_path(str(PROGRAM))
    assert jaxpf.media.open_frames("out.mp4").width == 384
    outcome = command("track", "clip.mp4", *STARTS["boxes"][1], "--no-overlay", "-o", "out")
    assert outcome.code == 0, outcome.err
    rows = jaxpf.boxes.read_boxes("out/tracks.csv").box[-2:]
    assert np.array_equal(rows, np.round(np.asarray(made["boxes"], float), 3))


PARTS = jaxpf.parts.Parts(
    names=("body", "arm"), parents=(-1, 0),
    poses=np.array([[150.0, 100.0, 0.0], [150.0, 150.0, np.pi / 6]]),
    sizes=np.array([[40.0, 60.0], [16.0, 50.0]]),
)  # fmt: skip
CONTOUR = [[100, 60], [180, 50], [200, 120], [150, 160], [90, 130]]
STARTS = {
    "boxes": (BOXES, ["--box=120,80,40,90", "--box=300,85,42,88"]),
    "points": ([[120.5, 80.0], [200.0, 90.0]], ["--point=120.5,80", "--point=200,90"]),
    "parts": (PARTS, ["--parts=parts.csv"]),
    "contours": (
        jaxpf.contours.Contours(("leaf",), np.array([CONTOUR], float)),
        ["--contours=contours.json"],
    ),
}
#: Options of the factory, and the flags that say the same.
GIVEN = {
    "boxes": (
        {"appearance": "colour", "sharpness": 3.0, "momentum": 0.1},
        ["--appearance=colour", "--sharpness=3", "--set=momentum=0.1"],
    ),
    "points": ({"method": "pffl", "noise_points": 4.0}, ["--method=pffl", "--noise-points=4"]),
    "parts": ({"num_particles": 50, "bands": 2}, ["--num-particles=50", "--set=bands=2"]),
    "contours": ({"method": "sir", "clutter": 2.0}, ["--method=sir", "--set=clutter=2"]),
}


@pytest.mark.parametrize("name", STARTS)
@pytest.mark.parametrize("given", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_tracker_is_that_of_the_command_line(name, given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    body, arm = ("body", "", 150, 100, 40, 60, 0), ("arm", "body", 150, 150, 16, 50, 30)
    write_parts(Path("parts.csv"), body, arm)
    write_contours(Path("contours.json"), {"leaf": CONTOUR})
    write_pictures(tmp_path, [FRAME] * 2)
    (start, flags), (options, more), module = STARTS[name], GIVEN[name], getattr(jaxpf, name)
    _, typed = built_by_track(name, tmp_path, *flags, *(more if given else []))
    made = module.tracker(FRAME, start, **(options if given else {}))
    assert_same(made, typed)
    there = getattr(module, f"to_{name}")(made, made.init(jax.random.key(0)).substates[0])
    assert np.isfinite(there).all()


@pytest.mark.parametrize(
    ("start", "options", "named"),
    [
        (BOXES, {"num_particels": 9}, "num_particles"),
        (BOXES, {"noise_points": 9}, "'noise_points'"),
        (BOXES, {"method": "best"}, "'best'"),
        (BOXES, {"like": "kalman1960"}, "kalman1960.*smith2004"),
        (BOXES, {"exclusion": "boxes", "appearance": "colour"}, "exclusion"),
        (BOXES, {"method": "ps", "ordering": jaxpf.ordering.dps(2)}, "method and ordering"),
        (BOXES, {"frame": FRAME / 255}, "uint8 RGB"),
        (BOXES, {"frame": None}, "likelihood"),
        ([[1, 2, 3, 0]], {}, "width and height"),
    ],
)
def test_what_cannot_be_made_is_refused(start, options, named):
    with pytest.raises(InputError, match=named):
        jaxpf.boxes.tracker(boxes=start, **{"frame": FRAME, **options})


def test_boxes_of_a_tracker_without_sizes_are_refused():
    made = jaxpf.boxes.tracker(
        None, BOXES, likelihood=jaxpf.likelihoods.Gaussian(np.ones((2, 3, 3), np.float32))
    )
    np.testing.assert_allclose(jaxpf.boxes.to_boxes(made, made.initial), BOXES)
    alone = dataclasses.replace(made, dynamics=jaxpf.dynamics.AR2(scale=np.ones(3, np.float32)))
    with pytest.raises(InputError, match="do not know the sizes"):
        jaxpf.boxes.to_boxes(alone, made.initial)
