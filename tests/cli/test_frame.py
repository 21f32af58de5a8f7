"""``jaxpf frame``: a picture to read boxes off."""

import cv2
import numpy as np
import pytest
from clips import grey, write_pictures
from command_line import jaxpf, refusal_of


@pytest.fixture
def images(tmp_path, monkeypatch):
    """Three frames of 64x48 pixels, each of one grey, in the present folder."""
    monkeypatch.chdir(tmp_path)
    return write_pictures(tmp_path / "images", [grey(50 * number) for number in range(3)])


def test_the_frame_is_saved_enlarged_with_a_grid(images, tmp_path):
    assert "images-frame-2.png" in jaxpf("frame", images, "--number", "2").out
    picture = cv2.imread(str(tmp_path / "images-frame-2.png"))
    assert picture.shape == (480, 640, 3)
    values, counts = np.unique(picture, return_counts=True)
    assert values[counts.argmax()] == 100  # the frame that was asked for
    assert len(values) > 3  # lines and labels over it


def test_a_wider_step_draws_fewer_lines(images, tmp_path):
    changed = []
    for step in ("4", "32"):
        path = tmp_path / f"{step}.png"
        jaxpf("frame", images, "-n", "1", "--step", step, "-o", path)
        changed.append(np.mean(cv2.imread(str(path)) != 50))
    assert changed[0] > 2 * changed[1] > 0


def test_an_earlier_picture_is_replaced_only_if_asked(images, tmp_path):
    path = tmp_path / "frame.PNG"
    path.write_text("old")
    assert "--overwrite" in refusal_of("frame", images, "-o", path)
    assert path.read_text() == "old"
    jaxpf("frame", images, "-o", path, "--overwrite")
    assert cv2.imread(str(path)) is not None


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ("images -n 3", "frame 3"),
        ("images -o frame.jpg", "'frame.jpg'"),
        ("images -o no/such/frame.png", "'no/such/frame.png'"),
        ("nowhere.mp4", "'nowhere.mp4'"),
        ("images -o images/x.png", "among the frames"),
    ],
)
def test_what_cannot_be_saved_is_refused_and_nothing_is_written(images, tmp_path, arguments, named):
    assert named in refusal_of("frame", *arguments.split())
    assert [path.name for path in tmp_path.iterdir()] == ["images"]
    assert sorted(path.name for path in images.iterdir()) == ["0.png", "1.png", "2.png"]
