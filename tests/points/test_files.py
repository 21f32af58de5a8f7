"""Files of points: what is read, what is written, what is refused."""

import numpy as np
import pytest
from refusals import message_of

from jaxpf.points.files import grid_points, parse_points, read_points


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
    "text",
    ["", "x,y\n", "1,2,3,4", "1,2\n1,b", "1,nan", "1,2," + "x" * 201, "1,2,a\n3,4,a"],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path, text):
    path = tmp_path / "points.csv"
    path.write_text(text)
    for place in (path, tmp_path, tmp_path / "nowhere.csv"):
        assert f"'{place}'" in message_of(read_points, place)


def test_typed_points():
    assert parse_points(["1,2,nose", "3, 4"]).names == ("nose", "1")
    assert "point '1'" in message_of(parse_points, ["1"])


def test_a_grid_lies_on_its_mask():
    mask = np.zeros((20, 30), bool)
    mask[5:15, 10:20] = True
    expected = [[12.5, 7.5], [17.5, 7.5], [12.5, 12.5], [17.5, 12.5]]
    np.testing.assert_array_equal(grid_points(mask, 5).places, expected)
    for wrong, step in ((mask, 0.5), (~mask & mask, 5)):
        message_of(grid_points, wrong, step)
