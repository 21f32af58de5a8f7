"""Annotated clips: read with their gaps, refused by line."""

import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.evaluation.scene import load_scene
from jaxpf.sequences import open_sequence
from jaxpf.targets.registry import target_of_scene

# Real clips, first on a folder made here


def test_a_clip_is_read_with_gaps_where_an_object_has_no_line(own_folder):
    clip = open_sequence(own_folder)
    assert (clip.name, clip.ids, clip.num_frames, clip.fps) == ("made", (2, 7), 3, 10)
    assert np.isnan(clip.boxes[0, 1]).all()
    np.testing.assert_array_equal(clip.boxes[:, 0], [[1, 2, 3, 4], [2, 2, 3, 4], [3, 2, 3, 4]])
    np.testing.assert_array_equal(clip.boxes[1:, 1], [[8.5, 1, 6, 5], [0, 0, 2, 2]])
    np.testing.assert_array_equal(clip.occlusion, [[0, -1], [1, -1], [2, 0]])


def test_how_hidden_objects_are_may_be_left_out(own_folder):
    boxes = open_sequence(own_folder).boxes
    rows = (own_folder / "gt.csv").read_text().splitlines()
    (own_folder / "gt.csv").write_text("".join(row.rpartition(",")[0] + "\n" for row in rows))
    clip = open_sequence(own_folder)
    np.testing.assert_array_equal(clip.boxes, boxes)
    assert (clip.occlusion == -1).all()


def test_a_clip_decodes_pictures_to_rgb_only_when_asked(own_folder):
    clip = open_sequence(own_folder)
    (own_folder / "frames" / "0002.png").unlink()
    pictures = iter(clip.frames)
    first = next(pictures)
    np.testing.assert_array_equal(first[0, :, 0], [50] * 12)
    np.testing.assert_array_equal(first[0, :, 2], np.arange(12))
    next(pictures)
    with pytest.raises(InputError, match=r"cannot read image .*0002\.png"):
        next(pictures)


def test_a_real_walk_through_a_campus(data_folder):
    scene = load_scene(data_folder / "tud_campus", ids=[1, 2, 3, 4, 5], start_frame=0)
    assert scene.frames.shape == (71, 480, 640, 3)
    np.testing.assert_array_equal(scene.boxes[0, 0], [398, 181, 121, 229])
    np.testing.assert_array_equal(scene.sizes[0], [121, 229])


@pytest.mark.slow
def test_every_annotated_real_clip_can_be_opened(data_folder):
    folders = [path.parent for path in sorted(data_folder.glob("*/gt.csv"))]
    assert folders
    for path in folders:
        clip = open_sequence(path)
        assert np.isfinite(clip.boxes).all(axis=-1).any(axis=0).all(), path
        assert next(iter(clip.frames)).shape == clip.frames.shape[1:]


def test_points_without_boxes_are_truth_for_points(own_folder):
    (own_folder / "gt.csv").unlink()
    rows = "frame,id,cx,cy,visible\n0,4,3,2,1\n0,7,5,4,1\n1,4,4,2.5,0\n1,7,6,4,1\n2,4,5,3,1\n"
    (own_folder / "points.csv").write_text(rows)
    scene = load_scene(own_folder, ids=[7, 4])
    target = target_of_scene(scene)
    assert target.name == "points"
    assert target.scene_start(scene).ids.tolist() == ["7", "4"]
    expected = [[(5, 4), (3, 2)], [(6, 4), (np.nan,) * 2], [(np.nan,) * 2, (5, 3)]]
    np.testing.assert_array_equal(target.scene_shapes(scene), expected)
