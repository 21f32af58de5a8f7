"""Start files as shapes on the page, and back."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from properties import EVERY, extents, names

from jaxpf import InputError
from jaxpf.cli.marking.starts import read_start, write_start
from jaxpf.contours.files import read_contours
from jaxpf.shapes.splines import points_on

BOX = {"kind": "boxes", "name": "1", "frame": 3, "x": 2.5, "y": 4.0, "w": 20.0, "h": 10.0}
LIMB = {"kind": "parts", "name": "arm", "frame": 0, "parent": "", "width": 6.0}
LIMB |= {"x1": 10.0, "y1": 10.0, "x2": 40.0, "y2": 50.0}
HAND = LIMB | {"name": "hand", "parent": "arm", "x1": 40.0, "y1": 50.0, "x2": 40.0, "y2": 60.0}

place, frame = st.floats(1, 4000), st.integers(0, 99)
named = {"name": names, "frame": st.just(0)}
#: Kind -> one shape of it.  A limb of no length has no direction, whose file has two decimals.
near = st.floats(1, 99)
SHAPES = {
    "boxes": {"name": st.integers(0, 999).map(str), "frame": frame, "w": extents, "h": extents},
    "points": named,
    "parts": named | {"parent": st.just(""), "width": near} | {"x1": near, "y1": near}
    | {"x2": st.floats(101, 199), "y2": near},
}  # fmt: skip
for kind in ("boxes", "points"):
    SHAPES[kind] = SHAPES[kind] | {"x": place, "y": place}


@EVERY
@given(data=st.data(), kind=st.sampled_from([*SHAPES]))
def test_what_is_drawn_is_read_again(kind, data, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "start.csv"
    one = st.fixed_dictionaries({"kind": st.just(kind), **SHAPES[kind]})
    shapes = data.draw(st.lists(one, min_size=1, max_size=3, unique_by=lambda s: s["name"]))
    path.unlink(missing_ok=True)
    write_start(path, kind, shapes)
    read = {shape["name"]: shape for shape in read_start(path, kind, 0)}
    assert read == {
        shape["name"]: {
            key: pytest.approx(value, rel=1e-5, abs=0.02) if isinstance(value, float) else value
            for key, value in shape.items()
        }
        for shape in shapes
    }


def test_a_part_hangs_on_its_parent_again(tmp_path):
    write_start(tmp_path / "start.csv", "parts", [LIMB, HAND])
    parents = [shape["parent"] for shape in read_start(tmp_path / "start.csv", "parts", 0)]
    assert parents == ["", "arm"]


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
    with pytest.raises(InputError, match="'head'"):
        write_start(path, "boxes", [BOX | {"name": "head"}])
    with pytest.raises(InputError, match="frames 0 and 4"):
        write_start(path, "parts", [LIMB, HAND | {"frame": 4}])
    assert not path.exists()
