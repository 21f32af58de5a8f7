"""``jaxpf example``: clips whose files agree, and commands that name what is there."""

import functools
import shlex

import numpy as np
import pytest
from command_line import jaxpf

from jaxpf.boxes import read_boxes
from jaxpf.contours.files import read_contours
from jaxpf.media import open_frames
from jaxpf.parts.files import read_parts
from jaxpf.points.files import read_points
from jaxpf.sequences.tables import dense

KINDS = {"boxes": 90, "parts": 60, "points": 60, "contours": 60, "detections": 120}
#: The others are made by the same function.
QUICK = ("boxes", "contours")


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """A function that gives the folder of a kind's example, and what was printed."""
    root = tmp_path_factory.mktemp("some examples")

    @functools.cache
    def made(kind):
        outcome = jaxpf("example", kind, root / kind)
        assert outcome.code == 0, outcome.err
        return root / kind, outcome.out

    return made


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[] if kind in QUICK else pytest.mark.slow) for kind in KINDS],
)
def test_the_commands_name_files_that_are_there(example, kind):
    folder, printed = example(kind)
    lines = [shlex.split(line) for line in printed.splitlines() if line.startswith("  jaxpf ")]
    assert lines
    assert sum(1 for _ in open_frames(folder / "clip.mp4")) == KINDS[kind]
    for line in lines:
        named = [word for word in line if word.startswith(str(folder))]
        output = line[line.index("-o") + 1]
        assert len(named) >= 2
        assert {word for word in named if not (folder / word).exists()} == {output}


@pytest.mark.slow
def test_starts_are_the_truth_of_the_first_frame(example):
    folders = {kind: example(kind)[0] for kind in KINDS}
    truth = dense(read_boxes(folders["boxes"] / "truth.csv"), [1, 2, 3], 90)
    assert np.isfinite(truth).all()
    start = dense(read_boxes(folders["boxes"] / "start.csv"), [1, 2, 3], 1)
    np.testing.assert_array_equal(start[0], truth[0])
    parts, points = (
        read_parts(folders["parts"] / "parts.csv"),
        read_points(folders["points"] / "points.csv"),
    )
    for kind, names, places in (
        ("parts", parts.names, parts.poses[:, :2]),
        ("points", points.names, points.places),
    ):
        rows = [line.split(",") for line in (folders[kind] / "truth.csv").open()][1:]
        first = {row[1]: (float(row[2]), float(row[3])) for row in rows if row[0] == "0"}
        np.testing.assert_allclose(places, [first[name] for name in names], atol=1e-3)
    assert read_contours(folders["contours"] / "wires.json").points.shape[0] == 2
    # People come and go.
    boxes = dense(read_boxes(folders["detections"] / "truth.csv"), [1, 2, 3, 4, 5], 120)
    there = np.isfinite(boxes[..., 0])
    assert not there[0].any()
    assert there.any(axis=0).all()
    assert not there[-1].all()
