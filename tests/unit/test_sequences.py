"""Where scenes come from: names, folders in three formats, users' functions."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import scenes
from scenes import Scene, SceneError, open_scene

SMALL = {"num_frames": 8, "frame_width": 120, "frame_height": 100, "num_objects": 2}
SEQINFO = (
    "[Sequence]\nname=made\nimDir=img1\nframeRate=12.5\nseqLength=8\nimWidth=120\n"
    "imHeight=100\nimExt=.png\n\n"
)


@pytest.fixture(scope="module")
def drawn():
    """A synthetic scene whose boxes, in eighths of a pixel, survive adding 1 without rounding."""
    small = {"object_width": 20, "object_height": 24, "lead_distance": 20.0, "leader_travel": 0.0}
    scene = scenes.make("distracter", seed=2, **SMALL, **small)
    return scene.frames, np.round(scene.boxes * 8) / 8


def write_pictures(folder, frames, first=1, digits=6, suffix=".png"):
    folder.mkdir(parents=True, exist_ok=True)
    for number, frame in enumerate(frames, start=first):
        assert cv2.imwrite(str(folder / f"{number:0{digits}d}{suffix}"), frame[..., ::-1])


def mot_rows(boxes, ids, tail="1,1,1"):
    """Lines of a gt.txt, by object as in the benchmark; frames, x and y from 1."""
    return [
        f"{t + 1},{number},{x + 1!r},{y + 1!r},{w!r},{h!r},{tail}"
        for column, number in enumerate(ids)
        for t, (x, y, w, h) in enumerate(boxes[:, column].tolist())
        if np.isfinite(x)
    ]


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


def otb_text(boxes, separator, end="\n"):
    """x and y from 1."""
    rows = boxes + np.array([1, 1, 0, 0])
    return "".join(separator.join(map(repr, row)) + end for row in rows.tolist())


def complaint_of(source, **options):
    with pytest.raises(SceneError) as caught:
        open_scene(source, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message


# Names


def test_a_name_opens_a_registered_scene():
    scene = open_scene("distracter", seed=3, parameters=SMALL)
    expected = scenes.make("distracter", 3, **SMALL)
    np.testing.assert_array_equal(scene.frames, expected.frames)
    np.testing.assert_array_equal(scene.boxes, expected.boxes)


def test_an_unknown_name_is_answered_with_all_that_is_possible():
    message = complaint_of("distractor")
    assert message.startswith("no scene 'distractor'")
    assert all(part in message for part in (*scenes.names(), "folder", "file.py:function"))


def test_what_chooses_from_recordings_is_refused_for_drawn_scenes():
    message = complaint_of("distracter", num_frames=3)
    assert "num_frames = 3" in message
    assert "'distracter'" in message
    assert "ids = [1]" in complaint_of("distracter", ids=[1])


def test_a_folder_may_be_called_like_a_scene(mot_folder, monkeypatch):
    mot_folder.rename(mot_folder.parent / "distracter")
    monkeypatch.chdir(mot_folder.parent)
    assert open_scene("distracter", parameters=SMALL).name == "distracter"
    assert open_scene("./distracter").name == "made"
    assert open_scene(Path("./distracter").absolute()).name == "made"


# MOTChallenge


def test_a_mot_sequence_round_trips_exactly(mot_folder, drawn):
    frames, boxes = drawn
    scene = open_scene(mot_folder)
    np.testing.assert_array_equal(scene.boxes, boxes)
    np.testing.assert_array_equal(scene.frames, frames)
    np.testing.assert_array_equal(scene.extras["ids"], [4, 9])
    np.testing.assert_array_equal(scene.extras["occlusion"], np.zeros((8, 2)))
    assert (scene.name, scene.fps) == ("made", 12.5)
    assert (scene.extras["start_frame"], scene.extras["source"]) == (0, str(mot_folder))
    x, y, w, h = np.rint(boxes[0, 1]).astype(int)
    assert abs(scene.patches[1].shape[0] - h) <= 1
    np.testing.assert_array_equal(
        scene.patches[1], frames[0, y : y + len(scene.patches[1]), x : x + w]
    )


def test_rows_that_mot_ignores_are_ignored(mot_folder, drawn):
    _, boxes = drawn
    rows = mot_rows(boxes, [4, 9])
    ignored = [
        "1,20,5,5,10,10,0,1,1",  # confidence 0
        "2,21,5,5,10,10,1,3,1",  # a car
        "2,22,5,5,10,10,0,7,0.5",  # someone standing still
    ]
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(rows[:8] + ignored + rows[8:]))
    clip = scenes.read_mot(mot_folder)
    assert clip.ids == (4, 9)
    np.testing.assert_array_equal(clip.boxes, boxes)


@pytest.mark.parametrize("tail", ["1,-1,-1,-1", "1,17.3,-4.2,0", "1,-1,-1", "0.7"])
def test_files_without_classes_keep_all_rows(mot_folder, drawn, tail):
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(mot_rows(drawn[1], [4, 9], tail)))
    scene = open_scene(mot_folder)
    np.testing.assert_array_equal(scene.boxes, drawn[1])
    np.testing.assert_array_equal(scene.extras["occlusion"], np.full((8, 2), -1))


def test_visibility_becomes_occlusion(mot_folder):
    rows = [
        f"{t},4,5,5,10,10,1,1,{v}" for t, v in enumerate(["1", "0.99", ".5", ".49", "0"], start=1)
    ]
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(rows))
    occlusion = open_scene(mot_folder).extras["occlusion"][:, 0]
    np.testing.assert_array_equal(occlusion, [0, 1, 1, 2, 2, -1, -1, -1])


def test_mot_pictures_may_have_more_digits(mot_folder, drawn):
    for path in sorted((mot_folder / "img1").iterdir()):
        path.rename(path.with_name(f"00{path.name}"))
    np.testing.assert_array_equal(open_scene(mot_folder).frames, drawn[0])


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("1,2,3", "3 values, not 6 to 10"),
        ("1,2,a,3,4,5,1", "column 3 = 'a' is not a finite number"),
        ("1.5,2,3,3,4,5,1", "frame = '1.5' is not a whole number"),
        ("0,2,3,3,4,5,1", r"frame must lie in 1\.\.8, counting from 1"),
        ("9,2,3,3,4,5,1", r"frame must lie in 1\.\.8"),
        ("1,2,3,3,0,5,1", "w and h must be above 0"),
        ("1,9,3,3,4,5,1", "second box for object 9 in frame 1"),
    ],
)
def test_a_malformed_mot_line_is_named(mot_folder, drawn, line, complaint):
    rows = mot_rows(drawn[1], [4, 9])
    (mot_folder / "gt" / "gt.txt").write_text("\n".join([*rows, line]))
    assert re.search(f"gt.txt, line 17: '{line}'.*{complaint}", complaint_of(mot_folder))


def test_missing_mot_files_are_named(mot_folder):
    (mot_folder / "img1" / "000003.png").rename(mot_folder / "away.png")
    assert "img1/000003.png is missing: seqinfo.ini says" in complaint_of(mot_folder)
    (mot_folder / "away.png").rename(mot_folder / "img1" / "000003.png")
    (mot_folder / "gt" / "gt.txt").rename(mot_folder / "gt" / "truth.txt")
    assert "gt/gt.txt is missing" in complaint_of(mot_folder)
    (mot_folder / "seqinfo.ini").unlink()
    assert "seqinfo.ini is missing" in complaint_of(mot_folder)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("[Sequence]", "", "no MOTChallenge description"),
        ("[Sequence]", "[Other]", "no MOTChallenge description"),
        ("seqLength=8\n", "", "no line seqLength="),
        ("seqLength=8", "seqLength=many", "seqLength = 'many' is not a whole number"),
        ("frameRate=12.5", "frameRate=0", "frameRate = '0' must be above 0"),
        ("imDir=img1", "imDir=elsewhere", "elsewhere holds no numbered pictures"),
        ("imWidth=120", "imWidth=121", "seqinfo.ini says 121 x 100"),
    ],
)
def test_a_wrong_seqinfo_is_named(mot_folder, old, new, complaint):
    (mot_folder / "seqinfo.ini").write_text(SEQINFO.replace(old, new))
    assert complaint in complaint_of(mot_folder)


def test_a_mot_file_of_ignored_rows_is_refused(mot_folder):
    (mot_folder / "gt" / "gt.txt").write_text("1,1,5,5,10,10,0,1,1\n")
    assert "no row that counts" in complaint_of(mot_folder)


# OTB


@pytest.mark.parametrize(("separator", "end"), [(",", "\r\n"), ("\t", "\n"), (" ", "\n")])
def test_an_otb_sequence_round_trips_exactly(otb_folder, drawn, separator, end):
    frames, boxes = drawn
    text = otb_text(boxes[:, 0], separator, end)
    (otb_folder / "groundtruth_rect.txt").write_bytes(text.encode())
    scene = open_scene(str(otb_folder))
    np.testing.assert_array_equal(scene.boxes, boxes[:, :1])
    assert (scene.name, scene.num_frames) == ("Made", 8)
    # JPEG blurs the noise of this scene, yet every frame is nearest to its own picture.
    distance = np.abs(scene.frames[:, None].astype(float) - frames[None]).mean(axis=(2, 3, 4))
    np.testing.assert_array_equal(distance.argmin(axis=1), np.arange(8))


def test_otb_separators_may_be_mixed(otb_folder):
    (otb_folder / "groundtruth_rect.txt").write_text("6\t7\t20\t24\n6 8 20 24\n6, 9, 20, 24\n")
    boxes = open_scene(otb_folder).boxes
    np.testing.assert_array_equal(boxes[:, 0], [[5, 6, 20, 24], [5, 7, 20, 24], [5, 8, 20, 24]])


def renumber(folder, first):
    for number, path in sorted(enumerate(sorted(folder.iterdir()), start=first), reverse=True):
        path.rename(folder / f"{number:04d}.jpg")


def test_otb_pictures_may_start_later_and_outnumber_the_lines(otb_folder, drawn):
    before = open_scene(otb_folder).frames
    renumber(otb_folder / "img", first=247)
    lines = otb_text(drawn[1][:6, 0], ",")
    (otb_folder / "groundtruth_rect.txt").write_text(lines)
    scene = open_scene(otb_folder)
    np.testing.assert_array_equal(scene.frames, before[:6])
    np.testing.assert_array_equal(scene.boxes[:, 0], drawn[1][:6, 0])


def test_the_truth_of_otb_david_begins_with_picture_300(otb_folder, drawn):
    before = open_scene(otb_folder).frames
    renumber(otb_folder / "img", first=298)
    (otb_folder / "groundtruth_rect.txt").write_text(otb_text(drawn[1][2:, 0], ","))
    david = otb_folder.rename(otb_folder.parent / "David")
    np.testing.assert_array_equal(open_scene(david).frames, before[2:])


def test_an_otb_sequence_may_have_several_objects_and_absences(otb_folder, drawn):
    boxes = drawn[1]
    (otb_folder / "groundtruth_rect.txt").unlink()
    first = otb_text(boxes[:7, 0], ",") + "0,0,0,0\n"
    (otb_folder / "groundtruth_rect.1.txt").write_text(first)
    second = "NaN,NaN,NaN,NaN\n" + otb_text(boxes[1:, 1], "\t")
    (otb_folder / "groundtruth_rect.2.txt").write_text(second)
    expected = boxes.copy()
    expected[7, 0] = expected[0, 1] = np.nan
    scene = open_scene(otb_folder, ids=[1, 2])
    assert scene.extras["start_frame"] == 1
    np.testing.assert_array_equal(scene.boxes, expected[1:])
    np.testing.assert_array_equal(open_scene(otb_folder).boxes, expected[:, :1])


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("1,2,3", "3 values, not 4"),
        ("1,2,b,4", "w = 'b' is not a finite number"),
        ("1,2,nan,4", "w = 'nan' is not a finite number"),
        ("1,2,-3,4", "w and h must be above 0"),
    ],
)
def test_a_malformed_otb_line_is_named(otb_folder, line, complaint):
    (otb_folder / "groundtruth_rect.txt").write_text(f"6,7,20,24\n{line}\n")
    assert f"groundtruth_rect.txt, line 2: '{line}'" in complaint_of(otb_folder)
    assert complaint in complaint_of(otb_folder)


def test_missing_otb_files_are_named(otb_folder, drawn):
    truth = otb_folder / "groundtruth_rect.txt"
    truth.write_text(truth.read_text() + "6,7,20,24\n")
    assert "0009.jpg is missing: groundtruth_rect.txt has 9 lines" in complaint_of(otb_folder)
    truth.unlink()
    assert "groundtruth_rect.txt is missing" in complaint_of(otb_folder)
    (otb_folder / "groundtruth_rect.1.txt").write_text("6,7,20,24\n")
    (otb_folder / "groundtruth_rect.2.txt").write_text("6,7,20,24\n6,7,20,24\n")
    assert "different numbers of lines, 1 and 2" in complaint_of(otb_folder)
    (otb_folder / "groundtruth_rect.2.txt").write_text("0,0,0,0\n")
    assert "holds no box" in complaint_of(otb_folder)
    (otb_folder / "groundtruth_rect.2.txt").unlink()
    (otb_folder / "img" / "0001.jpg").write_bytes(b"")
    assert "0001.jpg is not a picture" in complaint_of(otb_folder)


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
    scene = open_scene(folder, ids=[9, 4])
    assert scene.extras["start_frame"] == 3
    np.testing.assert_array_equal(scene.extras["ids"], [9, 4])
    np.testing.assert_array_equal(scene.boxes, boxes[3:, [1, 0]])
    np.testing.assert_array_equal(scene.frames, drawn[0][3:])
    x, y = np.rint(boxes[3, 1, :2]).astype(int)
    height, width = scene.patches[0].shape[:2]
    np.testing.assert_array_equal(scene.patches[0], drawn[0][3, y : y + height, x : x + width])


def test_by_default_the_objects_of_the_first_annotated_frame_are_chosen(entering):
    folder, boxes = entering
    np.testing.assert_array_equal(open_scene(folder).boxes, boxes[:, :1])
    np.testing.assert_array_equal(open_scene(folder, start_frame=4).boxes, boxes[4:])


def test_frames_are_cut_from_the_start_frame_on(entering, drawn):
    folder, boxes = entering
    scene = open_scene(folder, ids=[4], start_frame=2, num_frames=3)
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
    for number in (1, 2, 6, 7, 8):
        (folder / "img1" / f"{number:06d}.png").write_bytes(b"no picture")
    assert open_scene(folder, start_frame=2, num_frames=3, ids=[4]).num_frames == 3
    assert "000006.png: frame 5 is missing or is not a picture" in complaint_of(
        folder, start_frame=2, num_frames=4, ids=[4]
    )


def test_absent_objects_are_named_with_their_first_frame(entering):
    folder, _ = entering
    message = complaint_of(folder, ids=[4, 9], start_frame=1)
    assert message.endswith("in its start frame 1 object 9 is absent (it first appears in frame 3)")
    rows = "1,4,5,5,9,9,1\n5,9,5,5,9,9,1\n"
    (folder / "gt" / "gt.txt").write_text(rows)
    message = complaint_of(folder, ids=[4, 9])
    assert "4, 9 are together in no frame" in message
    assert "object 9 is seen from 4 to 4" in message
    assert "no object in frame 3; the first is in frame 0" in complaint_of(folder, start_frame=3)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"ids": [5]}, "no object 5; its ids are 4, 9"),
        ({"ids": [4, 4]}, "object 4 is asked for twice"),
        ({"ids": []}, "no ids were asked for"),
        ({"ids": ["4"]}, "ids = '4' must be a whole number"),
        ({"start_frame": 8}, "has the frames 0 to 7, not 8"),
        ({"start_frame": -1}, "has the frames 0 to 7, not -1"),
        ({"start_frame": 1.5}, "start_frame = 1.5 must be a whole number"),
        ({"start_frame": 6, "num_frames": 3}, r"num_frames must lie in 1..2, not 3"),
        ({"num_frames": 0}, r"num_frames must lie in 1..8, not 0"),
        ({"parameters": {"noise": 3}}, "has no parameters, but 'noise' was given"),
    ],
)
def test_a_choice_that_a_sequence_has_not_is_refused(mot_folder, options, complaint):
    assert complaint in complaint_of(mot_folder, **options)


def test_boxes_beyond_the_picture_stay_whole_and_give_the_part_inside(mot_folder, drawn):
    rows = ["1,4,-4,-9,20,30,1", "1,9,-19,5,20,20,1", "2,4,-4,-9,20,30,1", "2,9,112,5,20,20,1"]
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(rows))
    scene = open_scene(mot_folder, num_frames=1)
    np.testing.assert_array_equal(scene.extras["ids"], [4])  # 9 is annotated, but out of view
    np.testing.assert_array_equal(scene.boxes[0], [[-5, -10, 20, 30]])
    np.testing.assert_array_equal(scene.patches[0], drawn[0][0, :20, :15])
    both = open_scene(mot_folder, ids=[4, 9])
    assert both.extras["start_frame"] == 1
    np.testing.assert_array_equal(both.patches[1], drawn[0][1, 4:24, 111:])
    assert "object 9 is absent" in complaint_of(mot_folder, ids=[9], start_frame=0)


def test_a_video_is_opened_at_its_start_frame(tmp_path, drawn):
    frames, boxes = drawn
    path = tmp_path / "video.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (120, 100))
    if not writer.isOpened():
        pytest.skip("this build of OpenCV writes no MJPG video")
    for frame in frames:
        writer.write(np.ascontiguousarray(frame[..., ::-1]))
    writer.release()
    meta = {"name": "v", "frames": "video.avi", "n_frames": 8, "width": 120, "height": 100}
    (tmp_path / "meta.json").write_text(json.dumps(meta | {"fps": 10}))
    assert "gt.csv is missing" in complaint_of(tmp_path)
    lines = [f"{t},0,{','.join(map(repr, box))},0" for t, box in enumerate(boxes[:, 0].tolist())]
    (tmp_path / "gt.csv").write_text("\n".join(["frame,id,x,y,w,h,occ", *lines]))
    whole, part = open_scene(tmp_path), open_scene(tmp_path, start_frame=3, num_frames=2)
    np.testing.assert_array_equal(part.frames, whole.frames[3:5])
    np.testing.assert_array_equal(part.boxes, boxes[3:5, :1])
    (tmp_path / "meta.json").write_text(json.dumps(meta | {"fps": 10, "n_frames": 9}))
    assert "ends after 8 frames" in complaint_of(tmp_path)
    (tmp_path / "meta.json").unlink()
    assert "meta.json is missing" in complaint_of(tmp_path)


def test_unknown_folders_are_answered_with_the_formats(tmp_path):
    message = complaint_of(tmp_path)
    assert all(name in message for name in ("meta.json", "MOTChallenge", "OTB", str(tmp_path)))
    assert "does not exist" in complaint_of(tmp_path / "nowhere")
    assert "does not exist" in complaint_of("folder/nowhere")
    (tmp_path / "video.mp4").write_bytes(b"")
    assert "is a file, not a folder" in complaint_of(tmp_path / "video.mp4")


# Functions

SCENE_FILE = """
from dataclasses import dataclass

import numpy as np

import neighbour
from scenes import Scene, SceneError


@dataclass
class Settings:
    grey: "int"


def flat(seed, grey=7, gap=False):
    value = Settings(grey + seed).grey + neighbour.EXTRA
    frames = np.full((2, 6, 8, 3), value, np.uint8)
    boxes = np.tile([1.0, 1.0, 2.0, 3.0], (2, 1, 1))
    if gap:
        boxes[0] = np.nan
    return Scene("flat", frames, boxes, [frames[0, 1:4, 1:3]], 10.0, {})

def wrong(seed): return {"frames": 3}
def breaks(seed): raise RuntimeError("no\\ncamera")
def complains(seed): raise SceneError("grey = 900 must lie in 0..255")
def no_seed(): pass
def empty(seed):
    return Scene("e", np.zeros((2, 6, 8, 3), np.uint8), np.zeros((2, 0, 4)), [], 10.0, {})
number = 3
"""


@pytest.fixture
def scene_file(tmp_path):
    (tmp_path / "neighbour.py").write_text("EXTRA = 100\n")
    path = tmp_path / "my_scene.py"
    path.write_text(SCENE_FILE)
    return path


def test_a_function_in_a_file_makes_a_scene(scene_file):
    scene = open_scene(f"{scene_file}:flat", seed=2, parameters={"grey": 30})
    assert scene.name == "flat"
    assert np.all(scene.frames == 132)
    assert np.all(open_scene(f"{scene_file}:flat").frames == 107)


def test_files_of_one_name_are_told_apart(scene_file, tmp_path):
    open_scene(f"{scene_file}:flat")
    other = tmp_path / "other" / "my_scene.py"
    other.parent.mkdir()
    other.write_text(SCENE_FILE.replace("import neighbour\n", "").replace("neighbour.EXTRA", "0"))
    assert np.all(open_scene(f"{other}:flat").frames == 7)


def test_a_function_of_a_module_here_makes_a_scene(scene_file, monkeypatch):
    monkeypatch.chdir(scene_file.parent)
    scene_file.rename(scene_file.parent / "scene_module_here.py")
    assert open_scene("scene_module_here:flat", seed=1).frames[0, 0, 0, 0] == 108


def test_a_python_function_makes_a_scene(drawn):
    frames, boxes = drawn

    def recorded(seed):
        return Scene("r", frames, boxes, [frames[0, :2, :2]] * 2, 10.0, {"seed": seed})

    assert open_scene(recorded, seed=5).parameters == {"seed": 5}
    assert "start_frame = 1 chooses" in complaint_of(recorded, start_frame=1)


@pytest.mark.parametrize(
    ("name", "options", "complaint"),
    [
        ("wrong", {}, "returned a dict, not a scenes.Scene"),
        ("breaks", {}, "failed with RuntimeError: no camera"),
        ("no_seed", {}, "cannot be called with (seed=...)"),
        ("flat", {"parameters": {"blur": 1}}, "cannot be called with (seed=..., blur=...)"),
        ("flat", {"seed": -1}, "seed = -1 must be a whole number, 0 or more"),
        ("flat", {"parameters": {"gap": True}}, "object 1 has no box in the first frame"),
        ("empty", {}, "2 frames and 0 objects"),
        ("flet", {}, "has no function 'flet'; it defines breaks, complains, empty, flat, no_seed"),
        ("number", {}, "no function, 'number'"),
    ],
)
def test_a_function_that_makes_no_scene_is_refused(scene_file, name, options, complaint):
    message = complaint_of(f"{scene_file}:{name}", **options)
    assert complaint in message


def test_what_a_function_says_about_its_parameters_is_handed_on(scene_file):
    assert complaint_of(f"{scene_file}:complains") == "grey = 900 must lie in 0..255"


def test_functions_that_cannot_be_imported_are_named(scene_file, tmp_path):
    assert "there is no file nowhere.py" in complaint_of("nowhere.py:flat")
    message = complaint_of("no_such_package.module:flat")
    assert "'no_such_package.module:flat'" in message
    assert "No module named 'no_such_package'" in message
    scene_file.write_text("import no_such_package\n")
    assert "cannot be imported (ModuleNotFoundError" in complaint_of(f"{scene_file}:flat")
    scene_file.write_text("def flat(seed:\n")
    assert "cannot be imported (SyntaxError" in complaint_of(f"{scene_file}:flat")


# Real sequences


def test_real_walkers_are_opened_from_where_they_are_together(data_folder):
    clip = scenes.read_clip(data_folder / "tud_campus")
    scene = open_scene(data_folder / "tud_campus", ids=[7, 8], num_frames=3)
    start = scene.extras["start_frame"]
    np.testing.assert_array_equal(scene.boxes, clip.boxes[start : start + 3, [6, 7]])
    assert np.isfinite(scene.boxes[0]).all()
    assert not np.isfinite(clip.boxes[start - 1, [6, 7]]).all()
    frames = list(clip.frames(0, start + 1))
    np.testing.assert_array_equal(scene.frames[0], frames[start])


def test_real_pedestrians_come_and_go(data_folder):
    scene = open_scene(data_folder / "pets09_first400", num_frames=2)
    np.testing.assert_array_equal(scene.extras["ids"], [9, 15, 19])
    later = open_scene(data_folder / "pets09_first400", start_frame=223, num_frames=2)
    assert 1 in later.extras["ids"]
    assert 15 not in later.extras["ids"]


def test_the_campus_in_its_original_mot_format_is_the_same(data_folder, tmp_path):
    original = data_folder / "tud_campus" / "original"
    black = np.zeros((71, 480, 640, 3), np.uint8)
    write_pictures(tmp_path / "img1", black, suffix=".jpg")
    (tmp_path / "gt").mkdir()
    (tmp_path / "gt" / "gt.txt").write_bytes((original / "gt.txt").read_bytes())
    (tmp_path / "seqinfo.ini").write_bytes((original / "seqinfo.ini").read_bytes())
    clip, expected = scenes.read_mot(tmp_path), scenes.read_clip(data_folder / "tud_campus")
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
    scene, expected = open_scene(tmp_path, num_frames=4), open_scene(source, num_frames=4)
    np.testing.assert_array_equal(scene.boxes, expected.boxes)
    np.testing.assert_array_equal(scene.frames, expected.frames)
    clip = scenes.open_folder(tmp_path)
    np.testing.assert_array_equal(clip.boxes, scenes.open_folder(source).boxes)
