"""Files of points: what is read, what is written, what is refused."""

import numpy as np
import pytest

import jaxpf
from jaxpf.points.files import PointTrackWriter, grid_points, parse_points, read_points


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("x,y,name\n1,2,nose\n\n3.5,4,\n", ("nose", "1")),
        ("1,2\n3.5,4\n", ("0", "1")),
        ("\ufeffX, Y\n1, 2\n3.5, 4", ("0", "1")),
    ],
)
def test_points_are_read_with_and_without_names(tmp_path, text, names):
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    points = read_points(path)
    assert points.names == names
    np.testing.assert_array_equal(points.places, [[1, 2], [3.5, 4]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no points"),
        ("x,y\n", "holds no points"),
        ("1,2,3,4", "line 1 .* has 4 value"),
        ("1,2\n1,b", "line 2 .* not a finite number"),
        ("1,nan", "holds 'nan', which is not a finite number"),
        ("1,2,a\n3,4,a", "repeats the name 'a'"),
        ("1,2," + "x" * 201, "give 1 to 200 letters on one line"),
        ("1,2,a\n1,2,b", "at the place of 'a'"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path, text, message):
    path = tmp_path / "points.csv"
    path.write_text(text)
    with pytest.raises(jaxpf.InputError, match=message):
        read_points(path)


def test_missing_files_and_folders_are_refused(tmp_path):
    with pytest.raises(jaxpf.InputError, match="no file of points"):
        read_points(tmp_path / "nowhere.csv")
    with pytest.raises(jaxpf.InputError, match="is a folder"):
        read_points(tmp_path)


def test_typed_points():
    points = parse_points(["1,2,nose", "3, 4"])
    assert points.names == ("nose", "1")
    with pytest.raises(jaxpf.InputError, match="point '1' has 1 value"):
        parse_points(["1"])
    with pytest.raises(jaxpf.InputError, match="no point was given"):
        parse_points([])


def test_a_grid_lies_on_its_mask():
    mask = np.zeros((20, 30), bool)
    mask[5:15, 10:20] = True
    points = grid_points(mask, 5)
    np.testing.assert_array_equal(
        points.places, [[12.5, 7.5], [17.5, 7.5], [12.5, 12.5], [17.5, 12.5]]
    )
    for wrong, message in (
        ((mask, 0.5), "must be a number of at least 1"),
        ((mask[0], 5), "shape"),
        ((~mask & mask, 5), "no point"),
    ):
        with pytest.raises(jaxpf.InputError, match=message):
            grid_points(*wrong)


def test_tracks_are_written_frame_by_frame(tmp_path):
    path = tmp_path / "tracks.csv"
    with PointTrackWriter(path) as writer:
        writer.append(0, ["nose", "a,b"], [[1, 2], [3, 4]], [False, True])
        writer.append(1, ["nose", "a,b"], [[1, 2], [np.nan, 4]], [False, True])
    assert path.read_text().splitlines() == [
        "frame,point,x,y,hidden",
        "0,nose,1.000,2.000,0",
        '0,"a,b",3.000,4.000,1',
        "1,nose,1.000,2.000,0",
    ]
