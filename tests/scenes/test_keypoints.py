"""Keypoints of clips: what is read, and what is refused."""

import numpy as np
import pytest

from scenes import SceneError
from scenes.keypoints import read_keypoints

HEADER = "frame,id,joint,name,x,y,score\n"


@pytest.fixture
def folder(tmp_path):
    def write(text, header=HEADER):
        (tmp_path / "keypoints.csv").write_text(header + text)
        return tmp_path

    return write


def test_keypoints_are_read_by_frame_object_and_joint(folder):
    read = read_keypoints(
        folder("0,4,0,head,1,2,.5\n0,2,1,tail,3,4,.9\n2,4,0,head,5,6,\n\n2,4,1,tail,,,\n")
    )
    assert read.names == ("head", "tail")
    assert read.ids == (2, 4)
    assert read.places.shape == (3, 2, 2, 2)
    np.testing.assert_array_equal(read.places[0, 1, 0], [1, 2])
    np.testing.assert_array_equal(read.of(4, "tail", "head")[2], [[np.nan, np.nan], [5, 6]])
    assert read.scores[0, 0, 1] == 0.9
    assert np.isnan(read.places[1]).all()
    assert np.isnan(read.scores[2, 1, 0])
    with pytest.raises(SceneError, match="no keypoints of object 3; the ids are 2, 4"):
        read.of(3, "head")
    with pytest.raises(SceneError, match="no joint 'leg'; the joints are head, tail"):
        read.of(2, "leg")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,0,0,head,1,2\n", "line 2: '0,0,0,head,1,2' has 6 values, not 7"),
        ("0,0,zero,head,1,2,1\n", "joint = 'zero' is not a whole number"),
        ("0,0,0,head,1,two,1\n", "y = 'two' is not a finite number"),
        ("-1,0,0,head,1,2,1\n", "frame and joint count from 0"),
        ("0,0,0,head,1,2,1\n1,0,0,tail,1,2,1\n", "joint 0 was called 'head' before"),
        ("0,0,0,head,1,2,1\n0,0,0,head,1,2,1\n", "a second line for this joint in frame 0"),
        ("", "holds no keypoints"),
    ],
)
def test_every_mistake_has_one_clear_sentence(folder, text, words):
    with pytest.raises(SceneError, match=words):
        read_keypoints(folder(text))


def test_other_files_are_refused(folder, tmp_path):
    with pytest.raises(SceneError, match=r"keypoints.csv is missing"):
        read_keypoints(tmp_path / "gone")
    with pytest.raises(SceneError, match="the header must be"):
        read_keypoints(folder("", header="a,b\n"))
