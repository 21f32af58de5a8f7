"""Files of detections: read, written, and what is said of a bad one."""

import numpy as np
import pytest

import jaxpf
from jaxpf.detections.files import DETECTED, check_frames, read_detections, write_detections


def test_what_is_written_is_read_again_frame_by_frame(tmp_path):
    detections = [np.array([[0.0, 1, 20, 30], [5, 5, 10, 10]]), np.zeros((0, 4)), np.ones((1, 4))]
    write_detections(tmp_path / "det.txt", detections)
    table = read_detections(tmp_path / "det.txt")
    assert table.frame.tolist() == [0, 0, 2]
    assert (table.id == DETECTED).all()
    np.testing.assert_allclose(table.box, np.concatenate(detections))
    assert (tmp_path / "det.txt").read_text().startswith("1,-1,1.000,2.000,20.000,30.000,1,")


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("1,-1,1,1,9,9,1\n1,-1,1,1,9,x,1\n", "line 2 of .* h is 'x'"),
        ("1,-7,1,1,9,9,1\n", "line 1 of .* has the id -7"),
        ("1,3,1,1,9,9,1\n2,3,1,1,9,9,1\n", "line 2 of .* starts object 3 again, as line 1"),
    ],
)
def test_a_bad_line_is_refused_by_its_number(tmp_path, content, sentence):
    (tmp_path / "det.txt").write_text(content)
    with pytest.raises(jaxpf.InputError, match=sentence):
        read_detections(tmp_path / "det.txt")


def test_detections_come_by_frame_without_those_of_zero_size(tmp_path):
    rows = "2,-1,1,1,9,9,.5\n1,-1,5,1,9,9,1\n1,-1,6,1,9,0,1\n2,-1,4,1,9,9,0\n"
    (tmp_path / "det.txt").write_text(rows)
    table = read_detections(tmp_path / "det.txt")
    assert table.frame.tolist() == [0, 1, 1]
    assert table.confidence.tolist() == [1, 0.5, 0]


def test_a_frame_that_the_video_does_not_have_is_refused(tmp_path):
    (tmp_path / "det.txt").write_text("1,-1,1,1,9,9,1\n6,-1,1,1,9,9,1\n")
    table = read_detections(tmp_path / "det.txt")
    check_frames(table, 6)
    with pytest.raises(jaxpf.InputError, match="in frame 5, and the video ends with frame 4"):
        check_frames(table, 5)
