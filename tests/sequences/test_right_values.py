"""Every program reads the same frames and the same truth of a sequence."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import Image
from small_sequences import write_pictures

from jaxpf.boxes import read_boxes
from jaxpf.cli.tuning.command import _scenes_to_tune_on
from jaxpf.evaluation.scene import load_scene
from jaxpf.media import open_frames
from jaxpf.media.images import read_mask
from jaxpf.sequences import open_sequence
from jaxpf.sequences.layouts import read_truth
from jaxpf.sequences.tables import dense

T, SIZE = 5, (40, 60)


def tuned_on(folder):
    """The scene that ``jaxpf tune`` opens."""
    options = SimpleNamespace(scene_seed=0, train_scenes=1, set=(), ids=None, start_frame=None)
    options.frames = T - 2
    return _scenes_to_tune_on(str(folder), options)[0][0]


def assert_same_truth(folder, file, ids, expected):
    """``track --truth`` of the file and of the folder, ``evaluate`` and ``tune`` agree."""
    expected = np.array(expected, float)
    for place in (file, folder):
        table = read_truth(place)
        np.testing.assert_array_equal(np.unique(table.id), ids)
        np.testing.assert_array_equal(dense(table, ids, T), expected)
    np.testing.assert_array_equal(load_scene(str(folder), ids=ids).boxes, expected)
    np.testing.assert_array_equal(tuned_on(folder).boxes, expected[: T - 2])


@pytest.fixture
def folder(tmp_path):
    write_pictures(tmp_path / "img1", np.full((T, *SIZE, 3), 90, np.uint8))
    (tmp_path / "gt").mkdir()
    (tmp_path / "seqinfo.ini").write_text(
        f"[Sequence]\nframeRate=10\nseqLength={T}\nimWidth={SIZE[1]}\nimHeight={SIZE[0]}\n"
    )
    return tmp_path


def moving(x, absent=()):
    return [[[np.nan] * 4 if t in absent else [x + t, 4, 8, 9]] for t in range(T)]


@pytest.mark.parametrize(
    ("tail", "ignored"),
    [("1,1,1", "0,1,1"), ("1,1,1", "1,3,1"), ("1,-1,-1,-1", "0,-1,-1,-1")],  # without classes
)
def test_rows_flagged_0_or_of_another_class_are_no_truth(folder, tail, ignored):
    rows = [f"{t},{i},{t + 5},5,8,9,{e}" for t in range(1, 6) for i, e in ((4, tail), (7, ignored))]
    (folder / "gt" / "gt.txt").write_text("\n".join(rows))
    assert_same_truth(folder, folder / "gt" / "gt.txt", [4], moving(5))
    results = read_boxes(folder / "gt" / "gt.txt")  # of a tracker, whose scores and classes vary
    assert results.id.tolist() == [4, 7] * T


def test_a_row_of_zero_size_is_an_absent_object(folder):
    rows = [f"{t},4,{t + 5},5,{8 * (t != 3)},9,1,1,1" for t in range(1, 6)]
    (folder / "gt" / "gt.txt").write_text("\n".join(rows))
    assert_same_truth(folder, folder / "gt" / "gt.txt", [4], moving(5, absent=[2]))


def test_cvats_pixels_count_from_0_and_all_its_classes_count(folder):
    rows = [f"{t},4,{t + 5},5,8,9,1,3,1" for t in range(1, 6)]
    (folder / "gt" / "gt.txt").write_text("\n".join(rows))
    (folder / "gt" / "labels.txt").write_text("a\nb\nc\n")
    assert_same_truth(folder, folder / "gt" / "gt.txt", [4], np.add(moving(6), [0, 1, 0, 0]))


def test_truth_of_visdrone_is_read(tmp_path):
    folder = tmp_path / "sequences" / "uav1"
    write_pictures(folder, np.full((T, *SIZE, 3), 90, np.uint8), digits=7, suffix=".jpg")
    (tmp_path / "annotations").mkdir()
    file = tmp_path / "annotations" / "uav1.txt"
    counted = [f"{t},{i},{t + 5},4,8,9,1,{c},0,1" for t in range(1, 6) for i, c in ((0, 4), (3, 1))]
    regions = [f"{t},0,0,0,60,9,0,0,0,0" for t in range(1, 6)] * 2  # may repeat their number
    file.write_text("\n".join([*regions, *counted, "1,9,1,1,5,5,1,11,0,0"]))
    expected = np.repeat(moving(6), 2, axis=1)
    assert_same_truth(folder, file, [0, 3], expected)
    assert (load_scene(str(folder)).extras["occlusion"] == 1).all()


def test_lasot_got_10k_and_vot_are_read(tmp_path):
    lasot, vot = tmp_path / "cat-1", tmp_path / "ball1"
    write_pictures(lasot / "img", np.full((T, *SIZE, 3), 90, np.uint8), digits=8)
    (lasot / "groundtruth.txt").write_text("".join(f"{t + 6},5,8,9\n" for t in range(T)))
    (lasot / "out_of_view.txt").write_text("0,0,0,1,0")
    (lasot / "full_occlusion.txt").write_text("0,1,0,0,0")
    scene = load_scene(str(lasot))
    np.testing.assert_array_equal(scene.boxes, moving(5, absent=[3]))
    assert scene.extras["occlusion"][:, 0].tolist() == [-1, 2, -1, -1, -1]
    (lasot / "out_of_view.txt").rename(lasot / "absence.label")  # GOT-10k's
    for marks in ("0\n0\n0\n1\n0\n", "0\r\n\r\n0\r\n1", ",,,1,", "0, 0, 0, 1, 0"):
        (lasot / "absence.label").write_bytes(marks.encode())
        np.testing.assert_array_equal(load_scene(str(lasot)).boxes, moving(5, absent=[3]))
    write_pictures(vot, np.full((T, *SIZE, 3), 90, np.uint8), digits=8)
    corners = "{0},5,{1},5,{1},14,{0},14\n"
    text = "".join(corners.format(t + 6, t + 14) for t in range(T))
    (vot / "groundtruth.txt").write_text(text)
    np.testing.assert_array_equal(load_scene(str(vot)).boxes, moving(5))


def labels():
    """Cells 4, 8, ..., 80 that move right by one pixel a frame."""
    found = np.zeros((T, *SIZE), np.uint16)
    for t in range(T):
        for k in range(20):
            found[t, 10 * (k // 5) :, t + 10 * (k % 5) :][:6, :7] = 4 * (k + 1)
    return found


@pytest.mark.parametrize(
    ("dtype", "suffix"), [(np.uint8, "png"), (np.uint16, "png"), (np.uint16, "tif"), ("i4", "tif")]
)
def test_20_cells_numbered_to_80_stay_20_objects(tmp_path, dtype, suffix):
    place = tmp_path / "JPEGImages" / "480p" / "cells"
    write_pictures(place, np.full((T, *SIZE, 3), 90, np.uint8), first=0, digits=5)
    truth = tmp_path / "Annotations" / "480p" / "cells"
    truth.mkdir(parents=True)
    for t, image in enumerate(labels()):
        Image.fromarray(image.astype(dtype)).save(truth / f"{t:05d}.{suffix}")
        np.testing.assert_array_equal(read_mask(truth / f"{t:05d}.{suffix}"), image)
    ids = [4 * (k + 1) for k in range(20)]
    expected = [[(t + 10 * (k % 5), 10 * (k // 5), 7, 6) for k in range(20)] for t in range(T)]
    assert_same_truth(place, place, ids, expected)


def test_label_images_of_the_cell_tracking_challenge_are_read(tmp_path):
    write_pictures(tmp_path / "01", np.full((T, *SIZE, 3), 90, np.uint8), first=0, digits=3)
    (tmp_path / "01_GT" / "TRA").mkdir(parents=True)
    for t, image in enumerate(labels()):
        cv2.imwrite(str(tmp_path / "01_GT" / "TRA" / f"man_track{t:03d}.tif"), image)
    assert open_sequence(tmp_path / "01").boxes[2, 0].tolist() == [2, 0, 7, 6]


@pytest.mark.parametrize("by_png", [False, True])
def test_soft_edges_are_recognised_by_their_neighbours(tmp_path, by_png):
    """Also of a JPEG that was saved as PNG: few or many grey levels, one object."""
    big = cv2.circle(np.zeros((240, 320), np.uint8), (160, 120), 60, 255, -1)
    drawn = cv2.resize(big, (80, 60), interpolation=cv2.INTER_AREA)
    Image.fromarray(drawn).save(tmp_path / "0.jpg", quality=70)
    path = tmp_path / "0.jpg"
    if by_png:
        Image.open(path).save(tmp_path / "0.png")
        path = tmp_path / "0.png"
    mask = read_mask(path)
    assert np.unique(mask).tolist() == [0, 1]
    np.testing.assert_allclose(mask.sum(), drawn.sum() / 255, rtol=0.03)


def test_12_bits_in_png_of_16_are_equally_bright_everywhere(folder):
    for number, path in enumerate(sorted((folder / "img1").iterdir())):
        image = np.full((*SIZE, 3), 2048, np.uint16)
        image[:4] = 4095 if number == 0 else 300
        cv2.imwrite(str(path), image)
    (folder / "gt" / "gt.txt").write_text("".join(f"{t},4,6,5,8,9,1,1,1\n" for t in range(1, 6)))
    tracked = np.stack(list(open_frames(folder / "img1")))
    assert tracked[0, 9, 9].tolist() == [128] * 3
    np.testing.assert_array_equal(load_scene(str(folder)).frames, tracked)
    np.testing.assert_array_equal(tuned_on(folder).frames, tracked[: T - 2])
    later = load_scene(str(folder), start_frame=2)  # in which no pixel is bright
    np.testing.assert_array_equal(later.frames, tracked[2:])
