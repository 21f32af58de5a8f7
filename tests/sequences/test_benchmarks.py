"""Sequences of MOTChallenge and of OTB, read exactly."""

import numpy as np
import pytest
from small_sequences import mot_rows, otb_text

from jaxpf import InputError
from jaxpf.boxes import read_boxes
from jaxpf.detections.files import read_detections
from jaxpf.evaluation.scene import load_scene
from jaxpf.sequences import open_sequence

# MOTChallenge


def test_a_mot_sequence_round_trips_exactly(mot_folder, drawn):
    frames, boxes = drawn
    scene = load_scene(mot_folder)
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


@pytest.mark.parametrize("tail", ["1,-1,-1,-1", "1,17.3,-4.2,0", "1,-1,-1", "0.7"])
def test_files_without_classes_keep_all_rows(mot_folder, drawn, tail):
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(mot_rows(drawn[1], [4, 9], tail)))
    scene = load_scene(mot_folder)
    np.testing.assert_array_equal(scene.boxes, drawn[1])
    np.testing.assert_array_equal(scene.extras["occlusion"], np.full((8, 2), -1))


def test_visibility_becomes_occlusion(mot_folder):
    rows = [
        f"{t},4,5,5,10,10,1,1,{v}" for t, v in enumerate(["1", "0.99", ".5", ".49", "0"], start=1)
    ]
    (mot_folder / "gt" / "gt.txt").write_text("\n".join(rows))
    occlusion = load_scene(mot_folder).extras["occlusion"][:, 0]
    np.testing.assert_array_equal(occlusion, [0, 1, 1, 2, 2, -1, -1, -1])


def test_mot_pictures_may_have_more_digits(mot_folder, drawn):
    for path in sorted((mot_folder / "img1").iterdir()):
        path.rename(path.with_name(f"00{path.name}"))
    np.testing.assert_array_equal(load_scene(mot_folder).frames, drawn[0])


# OTB


@pytest.mark.parametrize(("separator", "end"), [(",", "\r\n"), ("\t", "\n"), (" ", "\n")])
def test_an_otb_sequence_round_trips_exactly(otb_folder, drawn, separator, end):
    frames, boxes = drawn
    text = otb_text(boxes[:, 0], separator, end)
    (otb_folder / "groundtruth_rect.txt").write_bytes(text.encode())
    scene = load_scene(str(otb_folder))
    np.testing.assert_array_equal(scene.boxes, boxes[:, :1])
    assert (scene.name, scene.num_frames) == ("Made", 8)
    # JPEG blurs the noise of this scene, yet every frame is nearest to its own picture.
    distance = np.abs(scene.frames[:, None].astype(float) - frames[None]).mean(axis=(2, 3, 4))
    np.testing.assert_array_equal(distance.argmin(axis=1), np.arange(8))


def test_otb_separators_may_be_mixed(otb_folder):
    (otb_folder / "groundtruth_rect.txt").write_text("6\t7\t20\t24\n6 8 20 24\n6, 9, 20, 24\n")
    boxes = load_scene(otb_folder).boxes
    np.testing.assert_array_equal(boxes[:, 0], [[5, 6, 20, 24], [5, 7, 20, 24], [5, 8, 20, 24]])


def renumber(folder, first):
    for number, path in sorted(enumerate(sorted(folder.iterdir()), start=first), reverse=True):
        path.rename(folder / f"{number:04d}.jpg")


def test_otb_pictures_may_start_later_and_outnumber_the_lines(otb_folder, drawn):
    before = load_scene(otb_folder).frames
    renumber(otb_folder / "img", first=247)
    lines = otb_text(drawn[1][:6, 0], ",")
    (otb_folder / "groundtruth_rect.txt").write_text(lines)
    scene = load_scene(otb_folder)
    np.testing.assert_array_equal(scene.frames, before[:6])
    np.testing.assert_array_equal(scene.boxes[:, 0], drawn[1][:6, 0])


def test_the_truth_of_otb_david_begins_with_picture_300(otb_folder, drawn):
    before = load_scene(otb_folder).frames
    renumber(otb_folder / "img", first=298)
    (otb_folder / "groundtruth_rect.txt").write_text(otb_text(drawn[1][2:, 0], ","))
    david = otb_folder.rename(otb_folder.parent / "David")
    np.testing.assert_array_equal(load_scene(david).frames, before[2:])


def test_an_otb_sequence_may_have_several_objects_and_absences(otb_folder, drawn):
    boxes = drawn[1]
    (otb_folder / "groundtruth_rect.txt").unlink()
    first = otb_text(boxes[:7, 0], ",") + "0,0,0,0\n"
    (otb_folder / "groundtruth_rect.1.txt").write_text(first)
    second = "NaN,NaN,NaN,NaN\n" + otb_text(boxes[1:, 1], "\t")
    (otb_folder / "groundtruth_rect.2.txt").write_text(second)
    expected = boxes.copy()
    expected[7, 0] = expected[0, 1] = np.nan
    scene = load_scene(otb_folder, ids=[1, 2])
    assert scene.extras["start_frame"] == 1
    np.testing.assert_array_equal(scene.boxes, expected[1:])
    np.testing.assert_array_equal(load_scene(otb_folder).boxes, expected[:, :1])


@pytest.mark.parametrize("blank", ["", "  ", "NaN,NaN,NaN,NaN", "0,0,0,0"])
@pytest.mark.parametrize("at", [0, 3])
def test_an_otb_line_without_a_box_keeps_the_frames_of_those_below(otb_folder, drawn, blank, at):
    lines = otb_text(drawn[1][:, 0], ",").splitlines()
    lines[at] = blank
    (otb_folder / "groundtruth_rect.txt").write_text("\n".join(lines) + "\n\n")
    expected = drawn[1][:, 0].copy()
    expected[at] = np.nan
    np.testing.assert_array_equal(open_sequence(otb_folder).boxes[:, 0], expected)


@pytest.mark.parametrize("row", ["{t},-1,{box}", "{t},-1,{box},1,-1,-1,-1"])
@pytest.mark.parametrize("read", [read_boxes, read_detections])
def test_boxes_in_shares_of_the_frame_are_refused(tmp_path, read, row):
    path = tmp_path / "boxes.csv"
    lines = [row.format(t=t, box="0.0104,0.4,0.25,0.5") for t in range(1, 4)]
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"boxes\.csv.*multiply"):
        read(path)
    pixel = [row.format(t=t, box="1,1,1,1") for t in range(1, 4)]
    path.write_text("\n".join(pixel))
    read(path)
