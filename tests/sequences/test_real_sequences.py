"""Real sequences are opened as their annotators left them."""

import numpy as np
import pytest
from small_sequences import write_pictures

from jaxpf.evaluation.scene import load_scene
from jaxpf.sequences import open_sequence

# Real sequences


def test_the_campus_in_its_original_mot_format_is_the_same(data_folder, tmp_path):
    original = data_folder / "tud_campus" / "original"
    black = np.zeros((71, 480, 640, 3), np.uint8)
    write_pictures(tmp_path / "img1", black, suffix=".jpg")
    (tmp_path / "gt").mkdir()
    (tmp_path / "gt" / "gt.txt").write_bytes((original / "gt.txt").read_bytes())
    (tmp_path / "seqinfo.ini").write_bytes((original / "seqinfo.ini").read_bytes())
    clip, expected = open_sequence(tmp_path), open_sequence(data_folder / "tud_campus")
    assert (clip.name, clip.ids, clip.fps) == ("TUD-Campus", expected.ids, expected.fps)
    np.testing.assert_array_equal(clip.boxes, expected.boxes)


@pytest.mark.parametrize("name", ["otb_crossing", "otb_dragonbaby"])
def test_otb_in_its_original_format_is_the_same(data_folder, tmp_path, name):
    source = data_folder / name
    (tmp_path / "img").mkdir()
    for path in (source / "frames").iterdir():
        (tmp_path / "img" / f"{int(path.stem) + 1:04d}.jpg").symlink_to(path)
    truth = (source / "original" / "groundtruth_rect.txt").read_bytes()
    (tmp_path / "groundtruth_rect.txt").write_bytes(truth)
    scene, expected = load_scene(tmp_path, num_frames=4), load_scene(source, num_frames=4)
    np.testing.assert_array_equal(scene.boxes, expected.boxes)
    np.testing.assert_array_equal(scene.frames, expected.frames)
    clip = open_sequence(tmp_path)
    np.testing.assert_array_equal(clip.boxes, open_sequence(source).boxes)
