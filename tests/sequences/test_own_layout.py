"""Annotated clips: read with their gaps, refused by line."""

import json

import cv2
import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.evaluation.opening import load_scene
from jaxpf.sequences import open_sequence
from jaxpf.targets import target_of_scene

# Real clips, first on a folder made here


HEADER = "frame,id,x,y,w,h,occ\n"


@pytest.fixture
def folder(tmp_path):
    """Three pictures of 12 x 8; object 2 in all of them, object 7 in the last two."""
    (tmp_path / "frames").mkdir()
    for number in range(3):
        picture = np.zeros((8, 12, 3), np.uint8)
        picture[..., 0] = 50 * (number + 1)  # red
        picture[..., 2] = np.arange(12)  # blue
        cv2.imwrite(str(tmp_path / "frames" / f"{number:04d}.png"), picture[..., ::-1])
    meta = {"name": "made", "frames": "frames/%04d.png", "n_frames": 3, "width": 12, "height": 8}
    (tmp_path / "meta.json").write_text(json.dumps({**meta, "fps": 10}))
    (tmp_path / "gt.csv").write_text(
        HEADER + "0,2,1,2,3,4,0\n1,7,8.5,1,6,5,-1\n1,2,2,2,3,4,1\n2,2,3,2,3,4,2\n2,7,0,0,2,2,0\n"
    )
    return tmp_path


def test_a_clip_is_read_with_gaps_where_an_object_has_no_line(folder):
    clip = open_sequence(folder)
    assert (clip.name, clip.ids, clip.num_frames, clip.fps) == ("made", (2, 7), 3, 10)
    assert np.isnan(clip.boxes[0, 1]).all()
    np.testing.assert_array_equal(clip.boxes[:, 0], [[1, 2, 3, 4], [2, 2, 3, 4], [3, 2, 3, 4]])
    np.testing.assert_array_equal(clip.boxes[1:, 1], [[8.5, 1, 6, 5], [0, 0, 2, 2]])
    np.testing.assert_array_equal(clip.occlusion, [[0, -1], [1, -1], [2, 0]])


def test_how_hidden_objects_are_may_be_left_out(folder):
    boxes = open_sequence(folder).boxes
    rows = (folder / "gt.csv").read_text().splitlines()
    (folder / "gt.csv").write_text("".join(row.rpartition(",")[0] + "\n" for row in rows))
    clip = open_sequence(folder)
    np.testing.assert_array_equal(clip.boxes, boxes)
    assert (clip.occlusion == -1).all()


def test_a_clip_decodes_pictures_to_rgb_only_when_asked(folder):
    clip = open_sequence(folder)
    (folder / "frames" / "0002.png").unlink()
    pictures = iter(clip.frames)
    first = next(pictures)
    np.testing.assert_array_equal(first[0, :, 0], [50] * 12)
    np.testing.assert_array_equal(first[0, :, 2], np.arange(12))
    next(pictures)
    with pytest.raises(InputError, match=r"cannot read image .*0002\.png"):
        next(pictures)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("1,2,3", "has 3 columns, .*expected 7"),
        ("1,2,a,2,3,4,0", "x is 'a', which is not a finite number"),
        ("1.5,2,3,2,3,4,0", "frame is '1.5'; give a whole number from 0"),
        ("1,2,3,2,-1,4,0", "w is '-1'; give a number from 0"),
        ("1,2,3,2,3,4,5", "occ is '5'; give a whole number from -1 to 2"),
        ("0,2,3,2,3,4,0", "repeats id 2 in the frame of line 2"),
    ],
)
def test_a_malformed_line_is_named(folder, line, complaint):
    (folder / "gt.csv").write_text(HEADER + "0,2,1,2,3,4,0\n" + line + "\n")
    with pytest.raises(InputError, match=rf"line 3 of .*gt\.csv'.*{complaint}"):
        open_sequence(folder)


def test_a_box_after_the_last_frame_is_refused(folder):
    (folder / "gt.csv").write_text(HEADER + "3,2,1,2,3,4,0\n")
    with pytest.raises(InputError, match=r"has a box in frame 3 .*the sequence has 3 frames"):
        open_sequence(folder)


def test_missing_files_are_named(folder):
    with pytest.raises(InputError, match="does not exist"):
        open_sequence(folder / "nowhere")
    (folder / "frames" / "0001.png").unlink()
    with pytest.raises(InputError, match=r"there is no picture .*0001\.png"):
        open_sequence(folder)
    (folder / "meta.json").unlink()
    with pytest.raises(InputError, match=r"no file of a description at .*meta\.json"):
        open_sequence(folder)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"n_frames": None}, "n_frames is 'None'"),
        ({"n_frames": 2.5}, r"n_frames is '2\.5'; give a whole number from 1"),
        ({"fps": 0}, "fps is '0'"),
        ({"width": 13}, "says 13 x 8 pixels, and the frames measure 12 x 8"),
        ({"frames": "%s.png"}, "describes no sequence .*frames is '%s.png'"),
    ],
)
def test_a_wrong_description_is_named(folder, change, complaint):
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | change))
    with pytest.raises(InputError, match=complaint):
        open_sequence(folder)
    (folder / "meta.json").write_text("{")
    with pytest.raises(InputError, match="describes no sequence"):
        open_sequence(folder)


def test_a_real_walk_through_a_campus(data_folder):
    scene = load_scene(data_folder / "tud_campus", ids=[1, 2, 3, 4, 5], start_frame=0)
    assert scene.frames.shape == (71, 480, 640, 3)
    np.testing.assert_array_equal(scene.boxes[0, 0], [398, 181, 121, 229])
    np.testing.assert_array_equal(scene.sizes[0], [121, 229])


def test_every_annotated_real_clip_can_be_opened(data_folder):
    folders = [path.parent for path in sorted(data_folder.glob("*/gt.csv"))]
    assert folders
    for path in folders:
        clip = open_sequence(path)
        assert np.isfinite(clip.boxes).all(axis=-1).any(axis=0).all(), path
        assert next(iter(clip.frames)).shape == clip.frames.shape[1:]


def test_points_without_boxes_are_truth_for_points(folder):
    (folder / "gt.csv").unlink()
    rows = "frame,id,cx,cy,visible\n0,4,3,2,1\n0,7,5,4,1\n1,4,4,2.5,0\n1,7,6,4,1\n2,4,5,3,1\n"
    (folder / "points.csv").write_text(rows)
    scene = load_scene(folder, ids=[7, 4])
    target = target_of_scene(scene)
    assert target.name == "points"
    assert target.scene_start(scene).ids.tolist() == ["7", "4"]
    expected = [[(5, 4), (3, 2)], [(6, 4), (np.nan,) * 2], [(np.nan,) * 2, (5, 3)]]
    np.testing.assert_array_equal(target.scene_shapes(scene), expected)
