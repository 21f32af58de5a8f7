"""A kind of target of one's own is one file, which registers it."""

import importlib
from importlib.metadata import EntryPoint
from pathlib import Path

import cv2
import numpy as np
import pytest
from command_line import jaxpf as command
from csv_rows import rows_of

from jaxpf import InputError
from jaxpf.targets import registry


@pytest.fixture(scope="module", autouse=True)
def entered():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parent))
        patch.setattr(registry, "_REGISTERED", {})
        module = importlib.import_module("own_target")
        registry.register(module.SPOTS)
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


def test_its_factory_checks_its_options(entered):
    frame = np.zeros((48, 64, 3), np.uint8)
    made = entered.tracker(frame, [[10, 12]], step=2, num_particles=9)
    assert (made.dynamics.step, made.num_particles) == (2.0, 9)
    with pytest.raises(InputError, match="step = -1 must be a finite number above 0"):
        entered.tracker(frame, [[10, 12]], step=-1)


def test_a_package_registers_it_by_an_entry_point(entered, monkeypatch):
    named = EntryPoint("spots", "own_target:SPOTS", "jaxpf.targets")
    monkeypatch.setattr(registry, "_REGISTERED", {})
    monkeypatch.setattr(registry, "entry_points", lambda group: [named][: group == named.group])
    registry._installed.cache_clear()
    assert registry.find_target("spots") is entered.SPOTS
    registry._installed.cache_clear()
