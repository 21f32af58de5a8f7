"""Exports are read back by the programs that they are made for, where these are installed."""

import zipfile

import numpy as np
import pytest
from command_line import refusal_of

#: Two objects in three frames; the second is lost in the last one and absent from the first.
TRACKS = """frame,time,id,x,y,w,h,speed,confidence,lost
0,0,1,10,5,8,4,,0.9,0
1,0.04,1,11.5,6,8,4,,0.8,0
1,0.04,2,30,20,6,9,,0.7,0
2,0.08,1,13,7,8,4,,0.9,0
2,0.08,2,31,20.25,6,9,,0.2,1
"""
#: By frame and id.
ROWS = [line.split(",") for line in TRACKS.splitlines()[1:]]
BOXES = {(int(row[0]), int(row[2])): [float(x) for x in row[3:7]] for row in ROWS}


@pytest.fixture
def export(result, exported):
    """A function that exports the tracks to a file of that name."""
    times, pictures = [0, 0.04, 0.08], ["a.png", "b.png", "c.png"]
    folder = result("boxes", TRACKS, times=times, pictures=pictures)
    return lambda form, name: exported(folder, form, name)


def test_pycocotools_reads_boxes_and_evaluates_them(export):
    coco = pytest.importorskip("pycocotools.coco")
    from pycocotools.cocoeval import COCOeval

    truth = coco.COCO(str(export("coco", "tracks.json")))
    names = {image["id"]: image["file_name"] for image in truth.loadImgs(truth.getImgIds())}
    assert names == {1: "a.png", 2: "b.png", 3: "c.png"}
    found = truth.loadAnns(truth.getAnnIds())
    assert {(a["image_id"] - 1, a["track_id"]): a["bbox"] for a in found} == BOXES
    evaluation = COCOeval(truth, truth.loadRes(found), "bbox")
    evaluation.evaluate()
    evaluation.accumulate()
    evaluation.summarize()
    assert evaluation.stats[0] == pytest.approx(1)


def test_supervision_reads_boxes_and_polygons_by_picture(export, tmp_path):
    supervision = pytest.importorskip("supervision")
    path = export("coco", "tracks.json")
    data = supervision.DetectionDataset.from_coco(str(tmp_path), str(path), force_masks=True)
    assert data.classes == ["object"]
    by_name = {str(name).rsplit("/", 1)[-1]: found for name, found in data.annotations.items()}
    for number, name in enumerate(["a.png", "b.png", "c.png"]):
        boxes = [np.add(b, [0, 0, *b[:2]]) for (frame, _), b in BOXES.items() if frame == number]
        np.testing.assert_allclose(by_name[name].xyxy, boxes)
        areas = [b[2] * b[3] for (frame, _), b in BOXES.items() if frame == number]
        np.testing.assert_allclose(by_name[name].mask.sum(axis=(1, 2)), areas, rtol=0.5)


def test_cvat_imports_the_archive_by_its_documented_layout(export):
    """CVAT, MOT 1.1: gt/gt.txt ``frame_id,track_id,x,y,w,h,not_ignored,class_id,visibility``.

    Frames and classes count from 1 and pixels from 0; gt/labels.txt names the classes.
    """
    with zipfile.ZipFile(export("cvat", "tracks.zip")) as archive:
        assert sorted(archive.namelist()) == ["gt/gt.txt", "gt/labels.txt"]
        assert archive.read("gt/labels.txt") == b"object\n"
        rows = [line.split(",") for line in archive.read("gt/gt.txt").decode().splitlines()]
    found = {(int(row[0]) - 1, int(row[1])): list(map(float, row[2:6])) for row in rows}
    assert found == BOXES
    for *_, not_ignored, class_id, visibility in rows:
        assert (int(not_ignored), int(class_id)) == (1, 1)
        assert 0 <= float(visibility) <= 1


POINTS = """frame,time,id,x,y,speed,confidence,lost
5,0.20,nose,1.5,2,,0.9,0
5,0.20,tail,3,4,,0.2,1
6,0.24,nose,2.5,2,,0.8,0
"""


@pytest.fixture
def keypoints(result, exported):
    """A function that exports keypoints; the tail is not reported in the second frame."""
    folder = result("points", POINTS, start=5, times=[0.2, 0.24])
    return lambda form: exported(folder, form, f"{form}.csv")


def test_pandas_reads_deeplabcut_predictions(keypoints):
    """DeepLabCut: index the frame, columns scorer, body part, and x, y or likelihood."""
    pandas = pytest.importorskip("pandas")
    table = pandas.read_csv(keypoints("dlc"), header=[0, 1, 2], index_col=0)
    assert table.columns.names == ["scorer", "bodyparts", "coords"]
    assert table.index.tolist() == [5, 6]
    nose = table["jaxpf", "nose"]
    np.testing.assert_allclose(nose[["x", "y", "likelihood"]], [[1.5, 2, 0.9], [2.5, 2, 0.8]])
    np.testing.assert_allclose(table["jaxpf", "tail"], [[3, 4, 0.2], 3 * [np.nan]])


def test_sleap_analysis_has_a_row_per_frame(keypoints):
    """SLEAP: track, frame_idx, instance.score, then x, y and score of each node."""
    lines = keypoints("sleap").read_text().splitlines()
    assert lines == [
        "track,frame_idx,instance.score,nose.x,nose.y,nose.score,tail.x,tail.y,tail.score",
        "jaxpf,5,0.55,1.5,2.0,0.9,3.0,4.0,0.2",
        "jaxpf,6,0.4,2.5,2.0,0.8,,,",
    ]


def test_sleap_io_reads_keypoints(keypoints):
    sleap = pytest.importorskip("sleap_io", reason="sleap-io is not installed")
    labels = sleap.load_csv(str(keypoints("sleap")), format="sleap", video="clip.mp4")
    assert [frame.frame_idx for frame in labels] == [5, 6]
    np.testing.assert_allclose(labels[0].instances[0].numpy(), [[1.5, 2], [3, 4]])


@pytest.mark.parametrize("form", ["dlc", "sleap"])
def test_boxes_are_no_keypoints(result, form):
    folder = result("boxes", TRACKS, times=[0, 0.04, 0.08])
    assert "choose coco" in refusal_of("export", folder, form, folder / "new.csv")
