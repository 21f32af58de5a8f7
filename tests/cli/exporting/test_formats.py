"""Tracks in the formats of other projects, read back, by their own readers where installed."""

import json
import zipfile

import cv2
import numpy as np
import pytest
from command_line import jaxpf

from jaxpf.boxes import write_mot
from jaxpf.cli.tracking.uncertainty_table import UncertaintyWriter
from jaxpf.parts.files import PartTrackWriter
from jaxpf.points.files import PointTrackWriter

BOXES = np.array([[[10.0, 5, 8, 4], [30, 20, 6, 9]], [[11.0, 6, 8, 4], [np.nan] * 4]])
#: Centre, size and angle of a part that lies on its side.
POSE, SIZE = np.array([[20.0, 15.0, np.pi / 2]]), np.array([[8.0, 4.0]])


@pytest.fixture
def result(tmp_path):
    """A function that makes the output folder of a target's tracks."""
    video, folder = tmp_path / "clip", tmp_path / "result"
    video.mkdir()
    folder.mkdir()
    for number in range(2):
        cv2.imwrite(str(video / f"{number}.png"), np.zeros((40, 60, 3), np.uint8))

    def make(target):
        about = {"parameters": {"target": target, "video": str(video)}}
        (folder / "summary.json").write_text(json.dumps(about))
        tracks = folder / "tracks.csv"
        if target == "boxes":
            frames, ids = np.repeat([0, 1], 2), [1, 2, 1, 2]
            write_mot(tracks, frames, ids, BOXES.reshape(-1, 4), [1, 1, 0.5, 1])
            with UncertaintyWriter(folder / "uncertainty.csv", ("x", "y", "scale"), 2) as writer:
                quantiles = np.arange(6.0).reshape(2, 3).T[:, None]
                writer.append(1, [1], [[15, 8]], [[1, 2]], quantiles=quantiles)
                some = [[[np.nan, 1]], [[2, 2]], [[np.nan, 3]]]  # of slots that come and go
                writer.append(0, [2], [[30, 20]], [[1, 2]], quantiles=some)
        elif target == "parts":
            with PartTrackWriter(tracks) as writer:
                writer.append(0, ["arm"], POSE, SIZE)
        else:
            with PointTrackWriter(tracks) as writer:
                writer.append(0, ["nose", "tail"], [[1, 2], [3, 4]], [False, True])
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
        (2, 1, [11, 6, 8, 4], 0.5),
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


@pytest.mark.parametrize("target", ["boxes", "points"])
def test_tracks_in_movements_layout(result, target):
    xarray = pytest.importorskip("xarray", reason="pip install 'jaxpf[formats]' for netCDF")
    data = xarray.load_dataset(exported(result(target), "movement", "tracks.nc"), engine="scipy")
    assert data.position.dims[:2] == ("time", "space")
    if target == "points":
        np.testing.assert_allclose(data.position.sel(keypoints="tail").squeeze(), [3, 4])
        np.testing.assert_allclose(data.confidence.squeeze(), [1, 0])
    else:
        np.testing.assert_allclose(data.position.sel(individuals="id_1"), [[14, 7], [15, 8]])
        np.testing.assert_allclose(data["shape"].isel(time=0), [[8, 6], [4, 9]])
        assert np.isnan(data.position.isel(time=1, individuals=1)).all()
        known = data.interval.sel(individuals="id_1").isel(time=1)
        np.testing.assert_allclose(known.sel(space="y"), [3, 4, 5])
        partly = data.interval.sel(individuals="id_2", space="x").isel(time=0)
        np.testing.assert_allclose(partly, [np.nan, 2, np.nan])


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
