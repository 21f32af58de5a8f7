"""Where scenes come from: names, folders, and the part of a sequence that is opened."""

import json
from pathlib import Path

import numpy as np
import pytest
from clips import write_table
from films import write_film
from small_sequences import SMALL, complaint_of, mot_rows

from jaxpf.evaluation.scene import load_scene


def test_a_folder_may_be_called_like_a_scene(mot_folder, monkeypatch):
    mot_folder.rename(mot_folder.parent / "distracter")
    monkeypatch.chdir(mot_folder.parent)
    assert load_scene("distracter", parameters=SMALL).name == "distracter"
    assert load_scene("./distracter").name == "made"
    assert load_scene(Path("./distracter").absolute()).name == "made"


# The part of a sequence that is opened


@pytest.fixture
def entering(mot_folder, drawn):
    """Object 9 enters in frame 3 and leaves after frame 5 (counting from 0)."""
    boxes = drawn[1].copy()
    boxes[:3, 1] = boxes[6:, 1] = np.nan
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(mot_rows(boxes, [4, 9])))
    return mot_folder, boxes


def test_a_scene_begins_where_all_chosen_objects_are_in_view(entering, drawn):
    folder, boxes = entering
    scene = load_scene(folder, ids=[9, 4])
    assert scene.extras["start_frame"] == 3
    np.testing.assert_array_equal(scene.extras["ids"], [9, 4])
    np.testing.assert_array_equal(scene.boxes, boxes[3:, [1, 0]])
    np.testing.assert_array_equal(scene.frames, drawn[0][3:])
    x, y = np.rint(boxes[3, 1, :2]).astype(int)
    height, width = scene.patches[0].shape[:2]
    np.testing.assert_array_equal(scene.patches[0], drawn[0][3, y : y + height, x : x + width])


def test_by_default_the_objects_of_the_first_annotated_frame_are_chosen(entering):
    folder, boxes = entering
    np.testing.assert_array_equal(load_scene(folder).boxes, boxes[:, :1])
    np.testing.assert_array_equal(load_scene(folder, start_frame=4).boxes, boxes[4:])


def test_frames_are_cut_from_the_start_frame_on(entering, drawn):
    folder, boxes = entering
    scene = load_scene(folder, ids=[4], start_frame=2, num_frames=3)
    np.testing.assert_array_equal(scene.boxes, boxes[2:5, :1])
    np.testing.assert_array_equal(scene.frames, drawn[0][2:5])
    assert scene.extras["occlusion"].shape == (3, 1)
    assert scene.parameters == {
        "source": str(folder),
        "ids": (4,),
        "start_frame": 2,
        "num_frames": 3,
    }


def test_only_the_frames_of_the_part_are_read(entering):
    folder, _ = entering
    for number in (2, 6, 7, 8):
        (folder / "img1" / f"{number:06d}.png").write_bytes(b"no picture")
    assert load_scene(folder, start_frame=2, num_frames=3, ids=[4]).num_frames == 3
    assert "000006.png' cannot be decoded" in complaint_of(
        folder, start_frame=2, num_frames=4, ids=[4]
    )


def test_absent_objects_are_named_with_their_frames(entering):
    folder, _ = entering
    message = complaint_of(folder, ids=[4, 9], start_frame=1)
    assert "cannot start in frame 1; its objects are in view in the frames: 4 in 0-7; 9 in 3-5" in (
        message
    )
    (folder / "gt" / "gt.txt").write_text("1,4,5,5,9,9,1\n5,9,5,5,9,9,1\n")
    assert "in the frames: 4 in 0; 9 in 4" in complaint_of(folder, ids=[4, 9])
    assert "cannot start in frame 3" in complaint_of(folder, start_frame=3)


def test_boxes_beyond_the_picture_stay_whole_and_give_the_part_inside(mot_folder, drawn):
    rows = ["1,4,-4,-9,20,30,1", "1,9,-19,5,20,20,1", "2,4,-4,-9,20,30,1", "2,9,112,5,20,20,1"]
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(rows))
    scene = load_scene(mot_folder, num_frames=1)
    np.testing.assert_array_equal(scene.extras["ids"], [4])  # 9 is annotated, but out of view
    np.testing.assert_array_equal(scene.boxes[0], [[-5, -10, 20, 30]])
    np.testing.assert_array_equal(scene.patches[0], drawn[0][0, :20, :15])
    both = load_scene(mot_folder, ids=[4, 9])
    assert both.extras["start_frame"] == 1
    np.testing.assert_array_equal(both.patches[1], drawn[0][1, 4:24, 111:])
    assert "9 in 1" in complaint_of(mot_folder, ids=[9], start_frame=0)


def test_a_video_is_opened_at_its_start_frame(tmp_path, drawn):
    frames, boxes = drawn
    write_film(tmp_path / "video.avi", frames, "mjpeg", "yuvj420p", rate=10)
    meta = {"name": "v", "frames": "video.avi", "n_frames": 8, "width": 120, "height": 100}
    (tmp_path / "meta.json").write_text(json.dumps(meta | {"fps": 10}))
    assert "gt.csv'; check the path" in complaint_of(tmp_path)
    rows = ((t, 0, box, 0) for t, box in enumerate(boxes[:, 0]))
    write_table(tmp_path / "gt.csv", "frame,id,x,y,w,h,occ", *rows)
    whole, part = load_scene(tmp_path), load_scene(tmp_path, start_frame=3, num_frames=2)
    np.testing.assert_array_equal(part.frames, whole.frames[3:5])
    np.testing.assert_array_equal(part.boxes, boxes[3:5, :1])
    (tmp_path / "meta.json").write_text(json.dumps(meta | {"fps": 10, "n_frames": 9}))
    assert "ends before frame 8" in complaint_of(tmp_path)
    (tmp_path / "meta.json").unlink()
    assert "meta.json'; check the path" in complaint_of(tmp_path)
