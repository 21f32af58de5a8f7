"""Parts of an experiment are measured once, whatever stops it in between."""

import contextlib
import sys
import types

import numpy as np
from command_line import jaxpf

from jaxpf.cli.reproduce import PAPERS
from jaxpf.errors import InputError
from jaxpf.experiments.comparison_table import Comparison
from jaxpf.experiments.parts import can_go_on, keeping, part


class Measured:
    """Counts how often it was asked, by name."""

    def __init__(self):
        self.asked = []

    def part(self, name):
        def measure():
            self.asked.append(name)
            return {"with a space": np.arange(3.0), "flags": np.array([True, False])}

        return part(name, measure)


def test_without_a_folder_parts_are_measured_each_time():
    measured = Measured()
    measured.part("a")
    found = measured.part("a")
    assert measured.asked == ["a", "a"]
    np.testing.assert_array_equal(found["with a space"], [0, 1, 2])


def test_what_was_measured_before_a_stop_is_not_measured_again(tmp_path):
    measured = Measured()
    with contextlib.suppress(KeyboardInterrupt), keeping(tmp_path, {"seed": 1}):
        measured.part("a")
        measured.part("b")
        raise KeyboardInterrupt
    assert can_go_on(tmp_path, {"seed": 1})
    assert not can_go_on(tmp_path, {"seed": 2})
    (tmp_path / "parts" / "b.npz").write_bytes(b"PK damaged")
    with keeping(tmp_path, {"seed": 1}):
        found = measured.part("a")
        measured.part("b")
    assert measured.asked == ["a", "b", "b"]
    assert list(found) == ["with a space", "flags"]
    assert found["flags"].dtype == bool
    assert not can_go_on(tmp_path, {"seed": 1})
    assert list(tmp_path.iterdir()) == []


def test_a_mistake_before_anything_is_measured_leaves_nothing(tmp_path):
    with contextlib.suppress(InputError), keeping(tmp_path, {"runs": 7}):
        raise InputError("--runs 7 must be a multiple of 5.")
    assert list(tmp_path.iterdir()) == []


def test_other_settings_begin_anew(tmp_path):
    measured = Measured()
    for seed in (1, 2):
        with contextlib.suppress(KeyboardInterrupt), keeping(tmp_path, {"seed": seed}):
            measured.part("a")
            raise KeyboardInterrupt
    assert measured.asked == ["a", "a"]


def test_the_command_goes_on_where_it_was(tmp_path, monkeypatch):
    measured, stops = Measured(), [InputError("the disk is full; make room.")]

    def run(runs, seed, quick, data, report):
        measured.part("a")
        if stops:
            raise stops.pop()
        measured.part("b")
        return Comparison("eskil2014", "a title", [], [], {}, ["a note"], {"seed": seed})

    module = types.SimpleNamespace(run=run)
    monkeypatch.setitem(sys.modules, "experiment_that_stops", module)
    monkeypatch.setitem(PAPERS, "eskil2014", "experiment_that_stops")
    command = ["reproduce", "eskil2014", "-o", str(tmp_path / "out")]
    assert jaxpf(*command).code == 2
    assert "is not empty" in jaxpf(*command, "--seed", "7").err
    result = jaxpf(*command)
    assert result.code == 0, result.err
    assert "Going on with what" in result.out
    assert measured.asked == ["a", "b"]
    assert not (tmp_path / "out" / "parts").exists()
    assert (tmp_path / "out" / "eskil2014.md").exists()
