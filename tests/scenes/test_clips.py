"""Annotated clips: read with their gaps, refused by line."""

import json

import cv2
import numpy as np
import pytest

import scenes
from scenes import SceneError

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
    clip = scenes.read_clip(folder)
    assert (clip.name, clip.ids, clip.num_frames, clip.fps) == ("made", (2, 7), 3, 10)
    assert np.isnan(clip.boxes[0, 1]).all()
    np.testing.assert_array_equal(clip.boxes[:, 0], [[1, 2, 3, 4], [2, 2, 3, 4], [3, 2, 3, 4]])
    np.testing.assert_array_equal(clip.boxes[1:, 1], [[8.5, 1, 6, 5], [0, 0, 2, 2]])
    np.testing.assert_array_equal(clip.occlusion, [[0, -1], [1, -1], [2, 0]])


def test_how_hidden_objects_are_may_be_left_out(folder):
    boxes = scenes.read_clip(folder).boxes
    rows = (folder / "gt.csv").read_text().splitlines()
    (folder / "gt.csv").write_text("".join(row.rpartition(",")[0] + "\n" for row in rows))
    clip = scenes.read_clip(folder)
    np.testing.assert_array_equal(clip.boxes, boxes)
    assert (clip.occlusion == -1).all()


def test_a_clip_decodes_pictures_to_rgb_only_when_asked(folder):
    clip = scenes.read_clip(folder)
    (folder / "frames" / "0002.png").unlink()
    pictures = clip.frames()
    first = next(pictures)
    np.testing.assert_array_equal(first[0, :, 0], [50] * 12)
    np.testing.assert_array_equal(first[0, :, 2], np.arange(12))
    next(pictures)
    with pytest.raises(SceneError, match="frame 2 is missing"):
        next(pictures)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("1,2,3", "3 values, not 7"),
        ("1,2,a,2,3,4,0", "x = 'a' is not a finite number"),
        ("1,2,nan,2,3,4,0", "x = 'nan' is not a finite number"),
        ("1.5,2,3,2,3,4,0", "frame = '1.5' is not a whole number"),
        ("3,2,3,2,3,4,0", r"frame must lie in 0\.\.2"),
        ("1,2,3,2,0,4,0", "w and h must be above 0"),
        ("1,2,3,2,3,4,5", "occ must be"),
        ("0,2,3,2,3,4,0", "second box for object 2 in frame 0"),
    ],
)
def test_a_malformed_line_is_named(folder, line, complaint):
    (folder / "gt.csv").write_text(HEADER + "0,2,1,2,3,4,0\n" + line + "\n")
    with pytest.raises(SceneError, match=f"gt.csv, line 3: '{line}'.*{complaint}"):
        scenes.read_clip(folder)


def test_missing_files_are_named(folder):
    with pytest.raises(SceneError, match="no such folder"):
        scenes.read_clip(folder / "nowhere")
    (folder / "gt.csv").rename(folder / "truth.csv")
    with pytest.raises(SceneError, match=r"gt\.csv is missing"):
        scenes.read_clip(folder)
    (folder / "truth.csv").rename(folder / "gt.csv")
    (folder / "frames" / "0000.png").unlink()
    with pytest.raises(SceneError, match=r"0000\.png is missing"):
        scenes.read_clip(folder)
    (folder / "meta.json").unlink()
    with pytest.raises(SceneError, match=r"meta\.json is missing"):
        scenes.read_clip(folder)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"n_frames": None}, "n_frames = None"),
        ({"n_frames": 2.5}, r"n_frames = 2\.5"),
        ({"fps": 0}, "fps = 0"),
        ({"name": 3}, "name = 3 must be text"),
    ],
)
def test_a_wrong_description_is_named(folder, change, complaint):
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | change))
    with pytest.raises(SceneError, match=complaint):
        scenes.read_clip(folder)


def test_wrong_json_and_a_wrong_header_are_named(folder):
    (folder / "gt.csv").write_text("frame,id,x,y\n0,2,1,2\n")
    with pytest.raises(SceneError, match="line 1: the header must be 'frame,id,x,y,w,h,occ'"):
        scenes.read_clip(folder)
    (folder / "meta.json").write_text("{")
    with pytest.raises(SceneError, match="not valid JSON"):
        scenes.read_clip(folder)


def test_pictures_of_another_size_than_described_are_refused(folder):
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | {"width": 13}))
    with pytest.raises(SceneError, match="frame 0 measures 12 x 8"):
        list(scenes.read_clip(folder).frames())


def test_a_video_that_ends_early_is_refused(folder):
    writer = cv2.VideoWriter(
        str(folder / "video.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48)
    )
    if not writer.isOpened():
        pytest.skip("this build of OpenCV writes no MJPG video")
    for _ in range(2):
        writer.write(np.full((48, 64, 3), 90, np.uint8))
    writer.release()
    meta = json.loads((folder / "meta.json").read_text())
    meta |= {"frames": "video.avi", "width": 64, "height": 48}
    (folder / "meta.json").write_text(json.dumps(meta))
    clip = scenes.read_clip(folder)
    with pytest.raises(SceneError, match="ends before frame 2"):
        list(clip.frames())
    (folder / "meta.json").write_text(json.dumps(meta | {"n_frames": 2}))
    (folder / "gt.csv").write_text(HEADER + "0,2,1,2,3,4,0\n")
    assert len(list(scenes.read_clip(folder).frames())) == 2


def test_a_real_walk_through_a_campus(data_folder):
    scene = scenes.open_scene(data_folder / "tud_campus", ids=[1, 2, 3, 4, 5], start_frame=0)
    assert scene.frames.shape == (71, 480, 640, 3)
    np.testing.assert_array_equal(scene.boxes[0, 0], [398, 181, 121, 229])
    np.testing.assert_array_equal(scene.sizes[0], [121, 229])


def test_every_annotated_real_clip_can_be_opened(data_folder):
    folders = [path.parent for path in sorted(data_folder.glob("*/gt.csv"))]
    assert folders
    for path in folders:
        clip = scenes.read_clip(path)
        assert np.isfinite(clip.boxes).all(axis=-1).any(axis=0).all(), path
        assert next(clip.frames()).shape == (clip.height, clip.width, 3)
