"""Sequences in the formats of the benchmarks."""

import json

import numpy as np
import pytest
from small_sequences import META, OWN_HEADER, SEQINFO, SMALL, mot_rows, otb_text, write_pictures

import scenes


@pytest.fixture(scope="session")
def drawn():
    """A synthetic scene whose boxes, in eighths of a pixel, survive adding 1 without rounding."""
    small = {"object_width": 20, "object_height": 24, "lead_distance": 20.0, "leader_travel": 0.0}
    scene = scenes.make("distracter", seed=2, **SMALL, **small)
    return scene.frames, np.round(scene.boxes * 8) / 8


@pytest.fixture
def mot_folder(tmp_path, drawn):
    """A MOTChallenge sequence; ids 4 and 9."""
    frames, boxes = drawn
    folder = tmp_path / "MADE-01"
    write_pictures(folder / "img1", frames)
    (folder / "seqinfo.ini").write_text(SEQINFO)
    (folder / "gt").mkdir()
    (folder / "gt" / "gt.txt").write_text("\n".join(mot_rows(boxes, [4, 9])) + "\n")
    return folder


@pytest.fixture
def otb_folder(tmp_path, drawn):
    """An OTB sequence with commas and Windows' line ends."""
    frames, boxes = drawn
    folder = tmp_path / "Made"
    write_pictures(folder / "img", frames, digits=4, suffix=".jpg")
    (folder / "groundtruth_rect.txt").write_bytes(otb_text(boxes[:, 0], ",", "\r\n").encode())
    return folder


@pytest.fixture
def own_folder(tmp_path):
    """Three pictures of 12 x 8; object 2 in all of them, object 7 in the last two."""
    pictures = np.zeros((3, 8, 12, 3), np.uint8)
    pictures[..., 0] = 50 * np.arange(1, 4)[:, None, None]  # red
    pictures[..., 2] = np.arange(12)  # blue
    write_pictures(tmp_path / "frames", pictures, first=0, digits=4)
    (tmp_path / "meta.json").write_text(json.dumps(META))
    rows = "0,2,1,2,3,4,0\n1,7,8.5,1,6,5,-1\n1,2,2,2,3,4,1\n2,2,3,2,3,4,2\n2,7,0,0,2,2,0\n"
    (tmp_path / "gt.csv").write_text(OWN_HEADER + rows)
    return tmp_path
