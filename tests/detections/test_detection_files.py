"""Files of detections: read, written, and what is said of a bad one."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from properties import EVERY, boxes

import jaxpf
from jaxpf.detections.files import DETECTED, read_detections, write_detections


@EVERY
@given(detections=st.lists(st.lists(boxes, max_size=3), min_size=1, max_size=4))
def test_what_is_written_is_read_again_frame_by_frame(tmp_path_factory, detections):
    if not any(detections):
        return
    path = tmp_path_factory.getbasetemp() / "det.txt"
    write_detections(path, [np.reshape(found, (-1, 4)) for found in detections])
    table = read_detections(path)
    assert table.frame.tolist() == [n for n, found in enumerate(detections) for _ in found]
    assert (table.id == DETECTED).all()
    np.testing.assert_allclose(table.box, np.concatenate([f for f in detections if f]), atol=6e-4)


def test_a_detection_counts_from_1_and_has_no_id(tmp_path):
    write_detections(tmp_path / "det.txt", [np.array([[0.0, 1, 20, 30]])])
    assert (tmp_path / "det.txt").read_text().startswith("1,-1,1.000,2.000,20.000,30.000,1,")


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("1,-7,1,1,9,9,1\n", "line 1 of .* id -7"),
        ("1,3,1,1,9,9,1\n2,3,1,1,9,9,1\n", "line 2 of .* object 3 .* line 1"),
    ],
)
def test_a_bad_line_is_refused_by_its_number(tmp_path, content, named):
    (tmp_path / "det.txt").write_text(content)
    with pytest.raises(jaxpf.InputError, match=named):
        read_detections(tmp_path / "det.txt")


def test_detections_come_by_frame_without_those_of_zero_size(tmp_path):
    rows = "2,-1,1,1,9,9,.5\n1,-1,5,1,9,9,1\n1,-1,6,1,9,0,1\n2,-1,4,1,9,9,0\n"
    (tmp_path / "det.txt").write_text(rows)
    table = read_detections(tmp_path / "det.txt")
    assert table.frame.tolist() == [0, 1, 1]
    assert table.confidence.tolist() == [1, 0.5, 0]
