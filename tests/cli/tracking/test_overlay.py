"""What the overlay of ``jaxpf track`` says of an object that was lost."""

import contextlib
from types import SimpleNamespace

import numpy as np

from jaxpf.boxes.target import BOXES
from jaxpf.cli.tracking.records import Record
from jaxpf.cli.tracking.writers import Overlay
from jaxpf.media import draw_boxes, object_colours

FRAME = np.full((90, 120, 3), 128, np.uint8)
START = BOXES.start([[20, 30, 30, 25], [70, 30, 30, 25]])


class _Video(contextlib.nullcontext):
    """Keeps the frames of a video instead of writing them."""

    def __init__(self, *_):
        super().__init__(self)
        self.frames = []

    def write(self, frame, time):
        self.frames.append(frame)
        assert time == len(self.frames[1:]) / 10


def test_an_object_found_again_is_doubtful_until_five_frames_confirm_it(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxpf.cli.tracking.writers.VideoWriter", _Video)
    # Of object 1: L lost, ? followed but doubtful, - followed.  Object 2 is never lost.
    story = "--LL??L????---L????--"
    colours = object_colours(2)
    with contextlib.ExitStack() as stack:
        scene = SimpleNamespace(target=BOXES, size=(120, 90), shown_at=lambda n: n / 10)
        overlay = Overlay(tmp_path, scene, SimpleNamespace(fps=25, pixel_aspect=1), stack)
        for number, mark in enumerate(story):
            lost = np.array([mark == "L", False])
            overlay(Record(number, FRAME, START, colours, START.shapes, None, lost))
    expected = {
        mark: draw_boxes(
            FRAME, START.shapes, START.ids, colours, [mark == "L", False], [mark == "?", False]
        )
        for mark in "L?-"
    }
    drawn = [
        "".join(mark for mark, picture in expected.items() if np.array_equal(frame, picture))
        for frame in overlay._video.frames
    ]
    assert "".join(drawn) == story
