"""Files of points: what is read and what is refused."""

import numpy as np
import pytest
from refusals import message_of

from jaxpf.points.files import read_points


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("x,y,name\n1,2,nose\n\n3.5,4,\n", ("nose", "1")),
        ("1,2\n3.5,4\n", ("0", "1")),
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
