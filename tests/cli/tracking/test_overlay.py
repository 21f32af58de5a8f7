"""What the overlay of ``jaxpf track`` says of an object that was lost."""

from types import SimpleNamespace

import numpy as np

from jaxpf.boxes.target import BOXES
from jaxpf.cli.tracking.overlay import Overlay
from jaxpf.detections import Record
from jaxpf.detections.records import Group
from jaxpf.media import draw_boxes, object_colours

FRAME = np.full((90, 120, 3), 128, np.uint8)
START = BOXES.start([[20, 30, 30, 25], [70, 30, 30, 25]])
NOBODY = np.zeros(2, bool)


class _Video:
    """Keeps the frames of a video instead of writing them."""

    def __init__(self, *_):
        self.frames = []

    def write(self, frame, time):
        self.frames.append(frame)
        assert time == len(self.frames[1:]) / 10


def test_an_object_found_again_is_doubtful_until_five_frames_confirm_it(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxpf.cli.tracking.overlay.VideoWriter", _Video)
    # Of object 1: L lost, ? followed but doubtful, - followed.  Object 2 is never lost.
    story = "--LL??L????---L????--"
    colours = object_colours(2)
    film = SimpleNamespace(
        width=120, height=90, fps=25, pixel_aspect=1, shown_at=lambda number: number / 10
    )
    overlay = Overlay(tmp_path, BOXES, film)
    for number, mark in enumerate(story):
        lost = np.array([mark == "L", False])
        group = Group(0, None, START, START.shapes, np.arange(2), NOBODY, NOBODY, lost)
        overlay.write(Record(number, FRAME, [group]), [{}])
    expected = {
        mark: draw_boxes(
            FRAME, START.shapes, START.ids, colours, [mark == "L", False], [mark == "?", False]
        )
        for mark in "L?-"
    }
    drawn = [
        "".join(mark for mark, picture in expected.items() if np.array_equal(frame, picture))
        for frame in overlay.video.frames
    ]
    assert "".join(drawn) == story
