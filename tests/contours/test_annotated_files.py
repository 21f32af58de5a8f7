"""Annotated contours: CSV and masks are read; what cannot be used is refused."""

import re

import cv2
import numpy as np
import pytest
from PIL import Image
from refusals import message_of

from jaxpf import InputError
from jaxpf.contours import Contours
from jaxpf.contours.factory import start
from jaxpf.contours.learning import read_annotated
from jaxpf.contours.target import OutlineFile


def write_lines(folder, rows, name="centrelines.csv"):
    folder.mkdir(exist_ok=True)
    (folder / name).write_text("\n".join(["frame,id,k,x,y", *rows]) + "\n")
    return folder


def test_points_are_read_by_frame_and_target_in_their_order(tmp_path):
    rows = ["1,b,1,5,6", "1,b,0,3,4", "", "0,a,0,1,2", "0,a,1,2,2.5", "7,a,0,9,9"]
    found = read_annotated(write_lines(tmp_path, rows), last=6)
    assert found.kind == "centrelines"
    assert list(found.lines) == [(0, "a"), (1, "b")]
    np.testing.assert_array_equal(found.lines[1, "b"], [(3, 4), (5, 6)])


def test_outlines_that_a_run_wrote_are_read_without_their_control_points(tmp_path):
    leaf = [[10, 20], [30, 18], [32, 40], [12, 38.5]]
    begun = start(Contours(("leaf",), [leaf]))
    with OutlineFile(tmp_path / "outlines.csv", begun) as write:
        write(2, begun.shapes)
    found = read_annotated(tmp_path)
    assert (found.kind, list(found.lines)) == ("outlines", [(2, "leaf")])
    np.testing.assert_allclose(found.lines[2, "leaf"].ravel(), begun.shapes[0], atol=0.00051)


def write_masks(folder, levels):
    folder.mkdir(exist_ok=True)
    for name, level in levels.items():
        cv2.imwrite(str(folder / f"{name}.png"), np.full((4, 5), level, np.uint8))


@pytest.mark.parametrize(
    ("levels", "frames"),
    [
        ({"a10": 1, "a2": 1, "a3": 0}, [2, 10]),
        ({"left": 1, "right": 0, "up": 1}, [0, 2]),
        ({"0003_mask": 1}, [3]),
        ({"0003_cam1_mask": 1, "0012_cam1_mask": 1}, [3, 12]),
    ],
)
def test_the_number_in_a_masks_name_is_its_frame(tmp_path, levels, frames):
    write_masks(tmp_path / "masks", levels)
    found = read_annotated(tmp_path)
    assert (found.kind, list(found.lines)) == ("masks", [(frame, "1") for frame in frames])
    assert found.lines[frames[0], "1"].shape == (4, 5)


@pytest.mark.parametrize(
    ("names", "named"),
    [
        (("1", "5", "x"), "x.png"),
        (("1", "01"), "1.png' has the number 1"),
        (("a1", "a2", "b1"), "b1.png' has the number 1"),
    ],
)
def test_masks_without_a_frame_of_their_own_are_refused(tmp_path, names, named):
    write_masks(tmp_path, dict.fromkeys(names, 1))
    assert named in message_of(read_annotated, tmp_path)


def test_several_objects_in_masks_are_listed_until_one_is_chosen(tmp_path):
    write_masks(tmp_path, {"1": 2, "2": 1})
    assert "--object" in message_of(read_annotated, tmp_path)
    assert list(read_annotated(tmp_path, value=2).lines) == [(1, "1")]
    assert "objects 1, 2; choose one" in message_of(read_annotated, tmp_path, value=3)


def test_an_indexed_mask_is_read_by_its_palette_index(tmp_path):
    """(128, 0, 0) and (0, 128, 0) are equally bright, and different objects."""
    indexed = Image.fromarray(np.uint8([[0, 1, 2], [0, 2, 2]]), mode="P")
    indexed.putpalette([0, 0, 0, 128, 0, 0, 0, 128, 0])
    indexed.save(tmp_path / "0.png")
    with pytest.raises(InputError, match="objects 1, 2"):
        read_annotated(tmp_path)
    one, two = (read_annotated(tmp_path, value=value).lines[0, "1"] for value in (1, 2))
    np.testing.assert_array_equal(one, [[False, True, False], [False, False, False]])
    np.testing.assert_array_equal(two, [[False, False, True], [False, True, True]])
    indexed.convert("RGB").save(tmp_path / "0.png")
    with pytest.raises(InputError, match=r"2 colours; .* as an indexed"):
        read_annotated(tmp_path)


TWO = ["0,1,0,5,6", "0,1,1,9,9", "3,1,0,5,6", "3,1,1,5,6"]


@pytest.mark.parametrize(
    ("rows", "options", "named"),
    [
        (["0,a,0,1"], {}, "line 2 of .* 4 columns"),
        (["0,a,0,1,inf"], {}, "line 2"),
        (["0.5,a,0,1,2"], {}, "line 2"),
        (["0,a,0,1,2"], {"first": 3}, "frames from 3 on"),
        (["0,a,0,1,2"], {"first": 3, "last": 1}, "frames from 3 to 1"),
        (["0,a,0,1,2"], {"value": 1}, "object 1"),
        (["0,a,0,1,2"], {"kind": "outlines"}, "outlines.csv"),
        (["0,a,0,1,2"], {"kind": "masks"}, "masks"),
        (TWO, {}, "target '1' in frame 3"),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, rows, options, named):
    folder = write_lines(tmp_path / "clip", rows)
    assert re.search(named, message_of(read_annotated, folder, **options))


def test_another_header_and_a_missing_folder_are_refused(tmp_path):
    (tmp_path / "outlines.csv").write_text("frame,id,x,y\n")
    assert "'frame,id,x,y'" in message_of(read_annotated, tmp_path)
    assert str(tmp_path / "none") in message_of(read_annotated, tmp_path / "none")


def test_photographs_are_no_masks(tmp_path):
    photograph = np.random.default_rng(0).integers(0, 255, (30, 40, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), photograph)
    message = message_of(read_annotated, tmp_path)
    assert re.search(r"a\.png' has 1200 colours.*not a photograph", message)
    cv2.imwrite(str(tmp_path / "a.png"), photograph[..., 0])
    message = message_of(read_annotated, tmp_path)
    assert "is a photograph, whose grey levels" in message


@pytest.mark.parametrize("suffix", ["png", "jpg", "jpeg"])
def test_soft_edges_end_at_half_the_maximum(tmp_path, suffix):
    scale = 5 if suffix == "png" else 1
    drawn = cv2.circle(
        np.zeros((60 * scale, 80 * scale), np.uint8), (40 * scale, 30 * scale), 15 * scale, 255, -1
    )
    drawn = cv2.resize(drawn, (80, 60), interpolation=cv2.INTER_AREA)
    if suffix == "jpeg":  # which leaves few grey levels beside these edges
        drawn = cv2.rectangle(np.zeros_like(drawn), (10, 10), (39, 29), 255, -1)
    Image.fromarray(drawn).save(tmp_path / f"0.{suffix}")
    marked = read_annotated(tmp_path).lines[0, "1"]
    np.testing.assert_allclose(marked.sum(), drawn.sum() / 255, rtol=0.02)


def test_hidden_files_are_no_masks_and_masks_have_one_size_and_one_picture(tmp_path):
    write_masks(tmp_path, {"1": 1})
    (tmp_path / "._1.png").write_bytes(b"left by a file system")
    assert list(read_annotated(tmp_path).lines) == [(1, "1")]
    cv2.imwrite(str(tmp_path / "2.png"), np.ones((9, 5), np.uint8))
    message = message_of(read_annotated, tmp_path)
    assert "2.png' is 5x9 and" in message
    cv2.imwritemulti(str(tmp_path / "2.tif"), [np.ones((4, 5), np.uint8)] * 2)
    (tmp_path / "2.png").unlink()
    assert "2.tif' holds 2 pictures" in message_of(read_annotated, tmp_path)
