"""Tracks in the formats of other projects, read back by their own readers where installed."""

import json
import zipfile

import numpy as np
import pytest
from command_line import jaxpf

from jaxpf import InputError
from jaxpf.boxes import read_boxes, read_tracks
from jaxpf.files.digests import digests
from jaxpf.files.writing import csv_text

TRACKS = {
    "boxes": """frame,time,id,x,y,w,h,x_2.5,x_97.5,y_2.5,y_97.5,speed,confidence,lost
0,0.00,1,10,5,8,4,,,,,,,0
0,0.00,2,30,20,6,9,,,,,,,0
1,0.04,1,11,6,8,4,9,13,5,8,7,0.4,1
""",
    # A part that lies on its side.
    "parts": """frame,time,id,x,y,w,h,angle,speed,lost
0,0.00,arm,20,15,8,4,90,,0
""",
    "points": """frame,time,id,x,y,speed,lost
0,0.00,nose,1,2,,0
0,0.00,tail,3,4,,1
""",
}


@pytest.fixture
def result(tmp_path):
    """A function that makes the output folder of a target's tracks; the video is gone."""
    folder = tmp_path / "result"
    folder.mkdir()

    def make(target, tracks=None, outlines=None, start=0, times=(0.0, 0.04), pictures=None):
        (folder / "tracks.csv").write_text(tracks or TRACKS[target])
        if outlines is not None:
            (folder / "outlines.csv").write_bytes(outlines)
        about = {
            "parameters": {"target": target, "video": "gone/clip.mp4", "start": start},
            "width": 60,
            "height": 40,
            "tables": digests(folder, ("tracks.csv", "outlines.csv")),
            "times": list(times),
            "pictures": pictures,
        }
        (folder / "summary.json").write_text(json.dumps(about))
        return folder

    return make


def exported(folder, form, name):
    outcome = jaxpf("export", folder, form, folder / name)
    assert outcome.code == 0, outcome.err
    return folder / name


def test_boxes_as_coco(result):
    content = json.loads(exported(result("boxes"), "coco", "tracks.json").read_text())
    assert [(one["id"], one["width"], one["height"]) for one in content["images"]] == [
        (1, 60, 40),
        (2, 60, 40),
    ]
    found = [(a["image_id"], a["track_id"], a["bbox"], a["score"]) for a in content["annotations"]]
    assert found == [
        (1, 1, [10, 5, 8, 4], 1),
        (1, 2, [30, 20, 6, 9], 1),
        (2, 1, [11, 6, 8, 4], 0.4),  # of a lost object, too
    ]
    assert [a["area"] for a in content["annotations"]] == [32, 54, 32]


def test_a_turned_part_as_coco(result):
    path = exported(result("parts"), "coco", "tracks.json")
    (part,) = json.loads(path.read_text())["annotations"]
    assert part["bbox"] == [18, 11, 4, 8]  # its sides change places
    assert part["area"] == 32
    mask = pytest.importorskip("pycocotools.coco", reason="COCO's own reader is not installed")
    assert mask.COCO(str(path)).annToMask(part).sum() == 32


def test_points_as_coco(result):
    path = exported(result("points"), "coco", "tracks.json")
    content = json.loads(path.read_text())
    assert content["categories"][0]["keypoints"] == ["nose", "tail"]
    assert content["annotations"][0]["keypoints"] == [1, 2, 2, 3, 4, 1]


def test_boxes_as_a_cvat_archive(result):
    with zipfile.ZipFile(exported(result("boxes"), "cvat", "tracks.zip")) as archive:
        lines = archive.read("gt/gt.txt").decode().splitlines()
        assert archive.read("gt/labels.txt") == b"object\n"
    assert lines[0] == "1,1,10.0,5.0,8.0,4.0,1,1,1"
    assert len(lines) == 3


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("cvat", "x.zip"), "points have none; choose coco"),
        (("coco", "x.txt"), "must end in .json"),
    ],
)
def test_what_cannot_be_written_is_refused(result, tmp_path, arguments, sentence):
    form, name = arguments
    outcome = jaxpf("export", result("points"), form, tmp_path / name)
    assert outcome.code == 2
    assert sentence in outcome.err
    assert not (tmp_path / name).exists()


def test_a_folder_without_results_is_refused(tmp_path):
    outcome = jaxpf("export", tmp_path, "coco", tmp_path / "x.json")
    assert outcome.code == 2
    assert "summary.json" in outcome.err


def test_boxes_as_mot_lines_count_from_1(result):
    lines = exported(result("boxes"), "mot", "tracks.txt").read_text().splitlines()
    assert lines == [
        "1,1,11.000,6.000,8.000,4.000,1,-1,-1,-1",
        "1,2,31.000,21.000,6.000,9.000,1,-1,-1,-1",
        "2,1,12.000,7.000,8.000,4.000,0.4,-1,-1,-1",
    ]


#: Boxes of the objects 2 and 7, the second absent from frame 1: [T, P, 4].
HEADER = "frame,time,id,x,y,w,h,lost"
ROUND = np.array([[[10.25, 5, 8, 4], [30, 20.5, 6, 9]], [[11.0, 6, 8, 4], [np.nan] * 4]])
ROUND_TRACKS = f"""{HEADER}
0,0.00,2,10.25,5,8,4,0
0,0.00,7,30,20.5,6,9,0
1,0.04,2,11,6,8,4,0
"""


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
def test_every_format_comes_back_with_its_ids_and_pixels(result, form, name, read):
    folder = result("boxes", ROUND_TRACKS)
    found = read(folder / name if form is None else exported(folder, form, name))
    expected = {(0, 2): ROUND[0, 0], (0, 7): ROUND[0, 1], (1, 2): ROUND[1, 0]}
    assert set(found) == set(expected)
    for key, box in expected.items():
        np.testing.assert_allclose(found[key], box, atol=1e-3)


def test_times_and_frames_are_those_of_the_tracks(result):
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


OUTLINES = "frame,contour,kind,point,x,y\n"


def outline(name):
    return "".join(f"0,{name},outline,{k},{5 + k},{6 + k * k}\n" for k in range(3))


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
@pytest.mark.parametrize(("form", "name"), [("coco", "t.json"), ("mot", "t.txt")])
def test_every_object_has_an_id_of_its_own(result, names, ids, form, name):
    header, row, *_ = TRACKS["parts"].splitlines()
    rows = [row.replace("arm", given) for given in names]
    path = exported(result("parts", "\n".join([header, *rows])), form, name)
    lines = path.read_text().splitlines()
    found = [int(line.split(",")[1]) for line in lines] if form == "mot" else read_coco(path)
    assert sorted(number if form == "mot" else number[1] for number in found) == ids


def test_names_that_start_with_0_keep_it(result):
    folder = result("points", TRACKS["points"].replace("nose", "01"))
    content = json.loads(exported(folder, "coco", "t.json").read_text())
    assert content["categories"][0]["keypoints"] == ["01", "tail"]
    tracks = "frame,time,id,x,y,speed,lost\n0,0,01,1,2,,0\n0,0,02,3,4,,0\n"
    outlines = OUTLINES + outline("01") + outline("02")
    result("contours", tracks, outlines.encode())
    assert len(read_coco(exported(folder, "coco", "u.json"))) == 2
    result("contours", tracks, f"{OUTLINES}{outline('01')}0,02,outline,0,1\n".encode())
    outcome = jaxpf("export", folder, "coco", folder / "v.json")
    assert outcome.code == 2
    assert "outlines.csv' is damaged" in outcome.err


@pytest.mark.parametrize(
    ("tracks", "sentence"),
    [
        ("frame,time,id,x,y,w,h\n0,0,1,5,5,8,4\n", "has no column 'lost', which tracks of boxes"),
        ("frame,time,id,lost\n0,0,1,0\n", "has no column 'x', which tracks of boxes have"),
        (f"{HEADER}\n0.5,0,1,5,5,8,4,0\n", "column frame of"),
        (f"{HEADER}\n-1,0,1,5,5,8,4,0\n", "holds other than whole numbers from 0 on"),
        (f"{HEADER}\n0,,1,5,5,8,4,0\n", "column time of"),
        (f"{HEADER}\n0,0,1,inf,5,8,4,0\n", "holds other than finite numbers"),
    ],
)
def test_damaged_tracks_are_refused(result, tracks, sentence):
    folder = result("boxes", tracks)
    outcome = jaxpf("export", folder, "coco", folder / "t.json")
    assert outcome.code == 2
    assert sentence in outcome.err


@pytest.mark.parametrize("outlines", [b"a,b\n1,2\n", b"\xff", b"", OUTLINES.encode()])
def test_damaged_outlines_are_refused(result, outlines):
    folder = result("boxes", outlines=outlines)
    outcome = jaxpf("export", folder, "coco", folder / "t.json")
    assert outcome.code == 2
    expected = "is not a text file" if outlines == b"\xff" else "outlines.csv' is damaged"
    assert expected in outcome.err


@pytest.mark.parametrize("target", ["boxes", "parts", "points"])
def test_no_tracks_cannot_be_exported(result, target):
    header = TRACKS[target].splitlines()[0]
    folder = result(target, f"{header}\n")
    outcome = jaxpf("export", folder, "mot", folder / "t.txt")
    assert outcome.code == 2
    assert "holds no tracks, so nothing can be exported" in outcome.err


def test_images_have_the_names_of_the_folders_pictures(result):
    folder = result("boxes", pictures=["img008.jpg", "img009.jpg"])
    images = json.loads(exported(folder, "coco", "t.json").read_text())["images"]
    assert [image["file_name"] for image in images] == ["img008.jpg", "img009.jpg"]
    images = json.loads(exported(result("boxes"), "coco", "u.json").read_text())["images"]
    assert [image["file_name"] for image in images] == ["clip_000000.png", "clip_000001.png"]


@pytest.mark.parametrize("name", ["tracks.csv", "outlines.csv"])
@pytest.mark.parametrize("harm", ["cut", "flipped", "doubled"])
def test_a_table_that_was_cut_or_changed_is_refused(result, name, harm):
    outlines = (OUTLINES + outline("1") + outline("2")).encode()
    folder = result("contours", TRACKS["boxes"], outlines)
    content = (folder / name).read_bytes()
    last = content.rindex(b"\n", 0, -1) + 1
    harmed = {
        "cut": content[:last],
        "flipped": content[: last - 2] + bytes([content[last - 2] ^ 1]) + content[last - 1 :],
        "doubled": content + content[last:],
    }
    (folder / name).write_bytes(harmed[harm])
    outcome = jaxpf("export", folder, "coco", folder / "t.json")
    assert outcome.code == 2
    assert f"{name}' was cut or changed after the run" in outcome.err
    assert not (folder / "t.json").exists()
    if name == "tracks.csv":
        for read in (read_tracks, read_boxes):
            with pytest.raises(InputError, match="was cut or changed"):
                read(folder / name)


def test_a_missing_table_and_a_summary_of_another_run_are_refused(result):
    folder = result("contours", TRACKS["boxes"], (OUTLINES + outline("1")).encode())
    (folder / "outlines.csv").unlink()
    outcome = jaxpf("export", folder, "coco", folder / "t.json")
    assert (outcome.code, "outlines.csv" in outcome.err) == (2, True)
    outcome = jaxpf("export", result("boxes", start=1), "coco", folder / "t.json")
    assert (outcome.code, "are of different runs" in outcome.err) == (2, True)
    outcome = jaxpf("export", result("boxes", pictures=["a.png"]), "coco", folder / "t.json")
    assert (outcome.code, "is no summary of this version" in outcome.err) == (2, True)


def test_names_that_look_like_formulas_come_back(result):
    name = "=cmd()"
    tracks = csv_text([["frame", "time", "id", "x", "y", "lost"], [0, 0.0, name, 1, 2, 0]])
    assert f"0,0.0,'{name},1" in tracks
    path = exported(result("points", tracks), "coco", "t.json")
    assert json.loads(path.read_text())["categories"][0]["keypoints"] == [name]
    rows = [["frame", "contour", "kind", "point", "x", "y"]]
    rows += [[0, name, "outline", k, k, k * k] for k in range(3)]
    folder = result("contours", tracks, csv_text(rows).encode())
    assert len(read_coco(exported(folder, "coco", "u.json"))) == 1
