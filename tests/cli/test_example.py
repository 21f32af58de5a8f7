"""``jaxpf example``: clips whose files agree, and commands that name what is there."""

import re
import shlex

import numpy as np
import pytest
from command_line import jaxpf, refusal_of

from jaxpf.boxes import dense, read_boxes
from jaxpf.contours.files import read_contours
from jaxpf.media import open_frames
from jaxpf.parts.files import read_parts
from jaxpf.points.files import read_points

KINDS = {"boxes": 90, "parts": 60, "points": 60, "contours": 60, "detections": 120}


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    """Kind -> (folder, what was printed)."""
    root = tmp_path_factory.mktemp("some examples")
    outcomes = {kind: jaxpf("example", kind, root / kind) for kind in KINDS}
    assert not any(outcome.code for outcome in outcomes.values()), outcomes
    return {kind: (root / kind, outcome.out) for kind, outcome in outcomes.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_the_commands_name_files_that_are_there(examples, kind):
    folder, printed = examples[kind]
    lines = [shlex.split(line) for line in printed.splitlines() if line.startswith("  jaxpf ")]
    assert lines
    assert sum(1 for _ in open_frames(folder / "clip.mp4")) == KINDS[kind]
    for line in lines:
        named = [word for word in line if word.startswith(str(folder))]
        output = line[line.index("-o") + 1]
        assert len(named) >= 2
        assert {word for word in named if not (folder / word).exists()} == {output}


def test_starts_are_the_truth_of_the_first_frame(examples):
    folders = {kind: folder for kind, (folder, _) in examples.items()}
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


def test_a_folder_with_files_is_refused(examples):
    assert re.search(
        r"is not empty .*--overwrite", refusal_of("example", "boxes", examples["boxes"][0])
    )
