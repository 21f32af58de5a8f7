"""Start files as shapes on the page, and back."""

import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.cli.marking.starts import read_start, write_start
from jaxpf.contours.files import read_contours
from jaxpf.shapes.splines import points_on

BOX = {"kind": "boxes", "name": "1", "frame": 3, "x": 2.5, "y": 4.0, "w": 20.0, "h": 10.0}
POINT = {"kind": "points", "name": "<b>, $x$", "frame": 0, "x": 2.5, "y": 4.0}
LIMB = {"kind": "parts", "name": "arm", "frame": 0, "parent": "", "width": 6.0}
LIMB |= {"x1": 10.0, "y1": 10.0, "x2": 40.0, "y2": 50.0}
HAND = LIMB | {"name": "hand", "parent": "arm", "x1": 40.0, "y1": 50.0, "x2": 40.0, "y2": 60.0}


@pytest.mark.parametrize(
    ("kind", "shapes"),
    [
        ("boxes", [BOX, BOX | {"name": "2", "frame": 9}]),
        ("points", [POINT, POINT | {"name": "eye", "x": 7.0}]),
        ("parts", [LIMB, HAND]),
    ],
)
def test_what_is_drawn_is_read_again(kind, shapes, tmp_path):
    write_start(tmp_path / "start.csv", kind, shapes)
    assert read_start(tmp_path / "start.csv", kind, 0) == [
        {key: pytest.approx(value, abs=0.02) if isinstance(value, float) else value
         for key, value in shape.items()}
        for shape in shapes
    ]  # fmt: skip


@pytest.mark.parametrize("closed", [True, False])
def test_a_contour_passes_through_its_points(closed, tmp_path):
    angle = np.linspace(0, 5.5, 9)
    points = np.stack([100 + 60 * np.cos(angle), 80 + 40 * np.sin(angle)], axis=1)
    shape = {"name": "leaf", "frame": 0, "points": points.tolist(), "closed": closed}
    path = tmp_path / "start.json"
    write_start(path, "contours", [shape | {"width": None if closed else 3.0}])
    contours = read_contours(path)
    line = points_on(contours.points[0], 400, closed=closed)
    far = np.linalg.norm(line[:, None] - points, axis=-1).min(axis=0)
    assert far.max() < 1.0
    again = read_start(path, "contours", 0)[0]["points"]
    assert np.linalg.norm(line[:, None] - again, axis=-1).min(axis=0).max() < 1.0


def test_what_no_start_file_can_hold_is_refused(tmp_path):
    path = tmp_path / "start.csv"
    with pytest.raises(InputError, match="box 'head' must be named by a whole number"):
        write_start(path, "boxes", [BOX | {"name": "head"}])
    with pytest.raises(InputError, match="drawn in frames 0 and 4; draw all in one"):
        write_start(path, "parts", [LIMB, HAND | {"frame": 4}])
    assert not path.exists()
