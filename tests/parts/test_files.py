"""Files of parts: what is read, what is refused and how."""

import re

import numpy as np
import pytest
from refusals import message_of

from jaxpf.parts.files import HEADER, read_parts

GOOD = """\
hand,arm,140,30,10,8,-90
arm,body,120.5,10,20,8,0

body,,100,20,20,40,45
"""


@pytest.fixture
def write(tmp_path):
    def write(text, header=HEADER):
        path = tmp_path / "parts.csv"
        path.write_text(f"{header}\n{text}", encoding="utf-8")
        return path

    return write


def test_parts_are_read_in_the_order_of_the_file(write):
    parts = read_parts(write(GOOD))
    assert parts.names == ("hand", "arm", "body")
    assert parts.parents == (1, 2, -1)
    expected = [[140, 30, -np.pi / 2], [120.5, 10, 0], [100, 20, np.pi / 4]]
    np.testing.assert_allclose(parts.poses, expected)
    np.testing.assert_allclose(parts.sizes, [[10, 8], [20, 8], [20, 40]])


def test_each_object_has_its_root(write):
    path = write("a,,1,1,2,2,0\nb,,9,9,2,2,0\nc,b,5,5,2,2,0\n")
    assert read_parts(path).parents == (-1, -1, 1)


ROOT = "a,,1,1,2,2,0\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("a,c,1,1,2,2,0\nb,a,1,1,2,2,0\nc,b,1,1,2,2,0\n", "'a' on 'c' on 'b' on 'a'"),
        ("a,a,1,1,2,2,0\n", "'a' on 'a'"),
        ("r,,1,1,2,2,0\nx,a,1,1,2,2,0\na,b,1,1,2,2,0\nb,a,1,1,2,2,0\n", "'a' on 'b' on 'a'"),
        (f"{ROOT}b,c,1,1,2,2,0\n", "line 3 of .*'b' hangs on 'c'"),
        ("a,,1,1,0,2,0\n", "line 2 of .*'a'.* 0 x 2"),
        (f"{ROOT}{ROOT}", "line 3 of .*'a' of line 2"),
        (",,1,1,2,2,0\n", "line 2 of .*the name ''"),
        ("a\x07,,1,1,2,2,0\n", "name"),
        ("a,,1,1,2,2\n", "line 2 of .* 6 column"),
        ("a,,1,one,2,2,0\n", "line 2 of .*y .*'one'"),
        ("a,,1,1,inf,2,0\n", "w .*'inf'"),
        ("", "no parts"),
    ],
)
def test_every_mistake_is_named(write, text, named):
    assert re.search(named, message_of(read_parts, write(text)))


def test_other_files_are_refused(write, tmp_path):
    assert "'frame,id'" in message_of(read_parts, write("0,1\n", header="frame,id"))
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\xff\xfe")
    for path in (tmp_path / "picture.csv", tmp_path / "gone.csv", tmp_path):
        assert f"'{path}'" in message_of(read_parts, path)
