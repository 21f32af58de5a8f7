"""A new target is one file and one line of the registry."""

import importlib
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from command_line import jaxpf as command
from csv_rows import rows_of

from jaxpf.targets import registry
from jaxpf.targets.target import Target


@pytest.fixture(scope="module", autouse=True)
def entered():
    """As if the files stood in ``jaxpf/spots``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parent))
        module = importlib.import_module("own_target")
        patch.setitem(sys.modules, "jaxpf.spots.target", module)
        patch.setattr(registry, "_TARGETS", (*registry._TARGETS, "spots"))  # the line
        yield module


@pytest.fixture
def clip(tmp_path):
    """One bright spot that moves to the right and down."""
    (tmp_path / "clip").mkdir()
    for time in range(6):
        frame = np.full((48, 64, 3), 20, np.uint8)
        cv2.circle(frame, (10 + 2 * time, 12 + time), 4, (255, 255, 255), -1)
        cv2.imwrite(str(tmp_path / "clip" / f"{time}.png"), frame)
    return tmp_path / "clip"


def test_it_is_tracked_from_the_command_line(clip, tmp_path):
    out = tmp_path / "out"
    outcome = command("track", "spots", clip, "--spot", "10,12,star", "--step", "2", "-o", out)
    assert outcome.code == 0, outcome.err
    rows = rows_of(out / "tracks.csv")
    assert [row["id"] for row in rows] == ["star"] * 6
    assert abs(float(rows[-1]["x"]) - 20) < 3
    assert abs(float(rows[-1]["y"]) - 17) < 3
    assert (out / "overlay.mp4").stat().st_size > 0
    outcome = command("track", "spots", clip)
    assert (outcome.code, "give --spot x,y" in outcome.err) == (2, True)


def test_its_help_shows_its_own_options():
    shown = command("track", "spots", "--help").out
    assert "--spot" in shown
    assert "--step" in shown
    assert "--box" not in shown


def test_one_that_lacks_a_method_cannot_be_made():
    with pytest.raises(TypeError, match=r"abstract .*, "):
        type("Half", (Target,), {"name": "half"})()
