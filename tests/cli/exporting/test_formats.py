"""Tracks in the formats of other projects, read back by their own readers where installed."""

import json
import zipfile

import numpy as np
import pytest
from command_line import jaxpf, refusal_of
from hypothesis import HealthCheck, given, settings, strategies as st
from properties import EVERY, boxes

from jaxpf.boxes import read_boxes
from jaxpf.files.writing import csv_text

BOXES = """frame,time,id,x,y,w,h,x_2.5,x_97.5,y_2.5,y_97.5,speed,confidence,lost
0,0.00,1,10,5,8,4,,,,,,,0
0,0.00,2,30,20,6,9,,,,,,,0
1,0.04,1,11,6,8,4,9,13,5,8,7,0.4,1
"""
#: On its side.
PARTS = """frame,time,id,x,y,w,h,angle,speed,lost
0,0.00,arm,20,15,8,4,90,,0
"""
POINTS = """frame,time,id,x,y,speed,lost
0,0.00,nose,1,2,,0
0,0.00,tail,3,4,,1
"""


def test_boxes_as_coco(result, exported):
    folder = result("boxes", BOXES)
    content = json.loads(exported(folder, "coco", "tracks.json").read_text())
    images = [(one["id"], one["width"], one["height"]) for one in content["images"]]
    assert images == [(1, 60, 40), (2, 60, 40)]
    names = [image["file_name"] for image in content["images"]]
    assert names == ["clip_000000.png", "clip_000001.png"]
    found = [(a["image_id"], a["track_id"], a["bbox"], a["score"]) for a in content["annotations"]]
    assert found == [
        (1, 1, [10, 5, 8, 4], 1),
        (1, 2, [30, 20, 6, 9], 1),
        (2, 1, [11, 6, 8, 4], 0.4),  # of a lost object, too
    ]
    assert [a["area"] for a in content["annotations"]] == [32, 54, 32]
    # Images have the names of the folder's pictures.
    folder = result("boxes", BOXES, pictures=["img008.jpg", "img009.jpg"])
    images = json.loads(exported(folder, "coco", "t.json").read_text())["images"]
    assert [image["file_name"] for image in images] == ["img008.jpg", "img009.jpg"]


def test_turned_parts_and_points_as_coco(result, exported):
    (part,) = json.loads(exported(result("parts", PARTS), "coco", "p.json").read_text())[
        "annotations"
    ]
    assert (part["bbox"], part["area"]) == ([18, 11, 4, 8], 32)  # its sides change places
    content = json.loads(exported(result("points", POINTS), "coco", "q.json").read_text())
    assert content["categories"][0]["keypoints"] == ["nose", "tail"]
    assert content["annotations"][0]["keypoints"] == [1, 2, 2, 3, 4, 1]


def refused(folder, form="coco", name="t.json"):
    sentence = refusal_of("export", folder, form, folder / name)
    assert not (folder / name).exists()
    return sentence


def test_what_cannot_be_written_is_refused(result, tmp_path):
    folder = result("points", POINTS)
    assert "coco" in refused(folder, "cvat", "x.zip")
    assert ".json" in refused(folder, "coco", "x.txt")
    assert "summary.json" in refused(tmp_path)


def test_boxes_as_mot_lines_count_from_1(result, exported):
    lines = exported(result("boxes", BOXES), "mot", "tracks.txt").read_text().splitlines()
    assert lines == [
        "1,1,11.000,6.000,8.000,4.000,1,-1,-1,-1",
        "1,2,31.000,21.000,6.000,9.000,1,-1,-1,-1",
        "2,1,12.000,7.000,8.000,4.000,0.4,-1,-1,-1",
    ]


HEADER = "frame,time,id,x,y,w,h,lost"


def read_coco(path):
    content = json.loads(path.read_text())
    return {(a["image_id"] - 1, a["track_id"]): a["bbox"] for a in content["annotations"]}


def read_mot(path):
    table = read_boxes(path)
    keys = zip(table.frame.tolist(), table.id.tolist(), strict=True)
    return dict(zip(keys, table.box.tolist(), strict=True))


def read_cvat(path):
    with zipfile.ZipFile(path) as archive:
        archive.extractall(path.parent / "cvat")
    return read_mot(path.parent / "cvat" / "gt" / "gt.txt")


@pytest.mark.parametrize(
    ("form", "name", "read"),
    [
        ("coco", "t.json", read_coco),
        ("cvat", "t.zip", read_cvat),
        ("mot", "t.txt", read_mot),
        (None, "tracks.csv", read_mot),
    ],
)
@settings(EVERY, max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    tracks=st.dictionaries(
        st.tuples(st.integers(0, 4), st.integers(1, 2**31)), boxes, min_size=1, max_size=6
    )
)
def test_every_format_comes_back_with_its_ids_and_pixels(result, form, name, read, tracks):
    rows = sorted((frame, frame / 25, one, *box, 0) for (frame, one), box in tracks.items())
    folder = result("boxes", csv_text([HEADER.split(","), *rows]), times=[n / 25 for n in range(5)])
    path = folder / name
    if form is not None:
        path.unlink(missing_ok=True)
        assert jaxpf("export", folder, form, path).code == 0
    found = read(path)
    assert set(found) == set(tracks)
    for key, box in tracks.items():
        np.testing.assert_allclose(found[key], box, rtol=1e-9, atol=1e-3)


def test_times_and_frames_are_those_of_the_tracks(result, exported):
    rows = ["4,0.5,1,10,5,8,4,0", "6,0.7,1,10,5,8,4,0", "7,1.7,1,10,5,8,4,0"]
    tracks = "\n".join([HEADER, *rows]) + "\n"
    folder = result("boxes", tracks, start=4, times=(0.5, 0.65, 0.7, 1.7))
    content = json.loads(exported(folder, "coco", "t.json").read_text())
    images = [(image["id"], image["time"]) for image in content["images"]]
    # No object was in frame 5.
    assert images == [(5, 0.5), (6, 0.65), (7, 0.7), (8, 1.7)]
    assert [each["image_id"] for each in content["annotations"]] == [5, 7, 8]
    lines = exported(folder, "mot", "t.txt").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["5", "7", "8"]


OUTLINES = "frame,id,k,x,y,kind\n"


def outline(name):
    return "".join(f"0,{name},{k},{5 + k},{6 + k * k},outline\n" for k in range(3))


@pytest.mark.parametrize(
    ("names", "ids"),
    [
        (("2", "9" * 5000), [1, 2]),
        (("2", "arm"), [1, 2]),
        (("arm", "1"), [1, 2]),
        (("-1", "5"), [-1, 5]),
        (("01", "1"), [1, 2]),
    ],
)
def test_every_object_has_an_id_of_its_own(result, exported, names, ids):
    header, row = PARTS.splitlines()
    folder = result("parts", "\n".join([header, *(row.replace("arm", name) for name in names)]))
    lines = exported(folder, "mot", "t.txt").read_text().splitlines()
    assert sorted(int(line.split(",")[1]) for line in lines) == ids
    assert sorted(number for _, number in read_coco(exported(folder, "coco", "t.json"))) == ids


def test_names_that_start_with_0_keep_it(result, exported):
    folder = result("points", POINTS.replace("nose", "01"))
    content = json.loads(exported(folder, "coco", "t.json").read_text())
    assert content["categories"][0]["keypoints"] == ["01", "tail"]
    tracks = "frame,time,id,x,y,speed,lost\n0,0,01,1,2,,0\n0,0,02,3,4,,0\n"
    outlines = OUTLINES + outline("01") + outline("02")
    result("contours", tracks, outlines.encode())
    assert len(read_coco(exported(folder, "coco", "u.json"))) == 2
    result("contours", tracks, f"{OUTLINES}{outline('01')}0,02,outline,0,1\n".encode())
    assert "outlines.csv' is damaged" in refused(folder, name="v.json")


@pytest.mark.parametrize(
    ("tracks", "outlines", "named"),
    [
        ("frame,time,id,x,y,w,h\n0,0,1,5,5,8,4\n", None, "'lost'"),
        ("frame,time,id,lost\n0,0,1,0\n", None, "'x'"),
        (f"{HEADER}\n0.5,0,1,5,5,8,4,0\n", None, "frame"),
        (f"{HEADER}\n-1,0,1,5,5,8,4,0\n", None, "frame"),
        (f"{HEADER}\n0,,1,5,5,8,4,0\n", None, "time"),
        (f"{HEADER}\n0,0,1,inf,5,8,4,0\n", None, "finite"),
        (f"{HEADER}\n", None, "no tracks"),
        (BOXES, b"a,b\n1,2\n", "outlines.csv"),
        (BOXES, b"\xff", "outlines.csv"),
        (BOXES, b"", "outlines.csv"),
        (BOXES, OUTLINES.encode(), "outlines.csv"),
    ],
)
def test_damaged_tables_are_refused(result, tracks, outlines, named):
    assert named in refused(result("boxes", tracks, outlines))


def test_a_summary_of_another_run_is_refused(result):
    assert "are of different runs" in refused(result("boxes", BOXES, start=1))
    more = result("boxes", BOXES, pictures=["a.png"])
    assert "is not a summary of this version" in refused(more)
