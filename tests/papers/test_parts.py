"""Parts of an experiment are measured once, whatever stops it in between."""

import contextlib
import csv
import importlib
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from command_line import jaxpf

from jaxpf import InputError
from jaxpf.evaluation.engine import Pool
from jaxpf.papers import PAPERS, paper
from jaxpf.papers.checkpoints import can_resume, keeping
from jaxpf.papers.judging.claims import claims_of
from jaxpf.papers.judging.estimates import computed
from jaxpf.papers.paper import Paper, paper_of
from jaxpf.papers.study import Study, named


class Measured:
    """Counts how often it was asked, by name."""

    def __init__(self):
        self.asked = []

    def part(self, measurements, name):
        def measure(seed):
            self.asked.append(name)
            return {"with a space": np.arange(3.0), "flags": np.array([True, False])}

        return measurements.of_scenes(name, measure, [0])


def test_what_was_measured_before_a_stop_is_not_measured_again(tmp_path):
    measured = Measured()
    with contextlib.suppress(KeyboardInterrupt), keeping(tmp_path, {"seed": 1}) as parts:
        measured.part(parts, "a")
        measured.part(parts, "b")
        raise KeyboardInterrupt
    assert can_resume(tmp_path, {"seed": 1})
    assert not can_resume(tmp_path, {"seed": 2})
    (tmp_path / "parts" / "b-0.npz").write_bytes(b"PK damaged")
    with contextlib.suppress(KeyboardInterrupt), keeping(tmp_path, {"seed": 1}) as parts:
        found = measured.part(parts, "a")
        measured.part(parts, "b")
        raise KeyboardInterrupt
    assert measured.asked == ["a", "b", "b"]
    assert list(found) == ["with a space", "flags"]
    assert found["flags"].dtype == bool
    with keeping(tmp_path, {"seed": 2}) as parts:  # other settings begin anew
        measured.part(parts, "a")
    assert measured.asked == ["a", "b", "b", "a"]
    with contextlib.suppress(InputError), keeping(tmp_path, {"scenes": 7}):
        raise InputError("a mistake before anything is measured leaves nothing.")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("pool", [Pool(partial(ThreadPoolExecutor, 3), 3), None])
def test_parts_that_are_shared_out_come_in_their_order_and_once(tmp_path, pool):
    asked = []

    def measure(number):
        time.sleep(0.02 * (3 - number))  # the first is the last to be ready
        asked.append(number)
        return {"number": number}

    def measured(parts, numbers):
        return list(parts.of_scenes("part", measure, numbers, threads=2)["number"])

    with contextlib.suppress(KeyboardInterrupt), keeping(tmp_path, {}, pool=pool) as parts:
        assert measured(parts, [2, 1]) == [2, 1]
        raise KeyboardInterrupt
    with keeping(tmp_path, {}, pool=pool) as parts:
        assert measured(parts, range(4)) == [0, 1, 2, 3]
    assert sorted(asked) == [0, 1, 2, 3]


def test_the_command_goes_on_where_it_was(tmp_path, monkeypatch):
    measured, stops = Measured(), [InputError("the disk is full; make room.")]

    def measure(seeds, quick, parts):
        measured.part(parts, "a")
        if stops:
            raise stops.pop()
        measured.part(parts, "b")
        return Study({})

    stopping = Paper(
        "eskil2014", measure, lambda study: {}, lambda: {"fish_kept": [computed(95.0)]}
    )
    monkeypatch.setattr(paper, "paper_of", lambda name: stopping)
    command = ["reproduce", "eskil2014", "-o", str(tmp_path / "out")]
    assert jaxpf(*command).code == 2
    other = jaxpf(*command, "--seed", "7")
    assert other.code == 2
    assert "is not empty" in other.err
    assert "--overwrite" in other.err
    result = jaxpf(*command)
    assert result.code == 0, result.err
    assert "Resuming from" in result.out
    assert measured.asked == ["a", "b"]
    assert not (tmp_path / "out" / "parts").exists()
    assert (tmp_path / "out" / "eskil2014.md").exists()
    (verdict,) = csv.DictReader((tmp_path / "out" / "verdicts.csv").read_text().splitlines())
    assert verdict["command"].startswith("jaxpf reproduce eskil2014 --scenes 50 --seed 0")
    # The quick version and the full one do not get into each other's way.
    monkeypatch.chdir(tmp_path)
    for quick in ([], ["--quick"]):
        assert jaxpf("reproduce", "eskil2014", *quick).code == 0
    assert (tmp_path / "jaxpf-eskil2014" / "eskil2014.md").exists()
    assert (tmp_path / "jaxpf-eskil2014-quick" / "eskil2014.md").exists()


@pytest.mark.parametrize("name", PAPERS)
def test_papers_look_alike(name):
    """The same files in every folder, at least 25 scenes, and every measure has its use."""
    found = paper_of(name)
    assert found.name == name
    for file in ("scenes", "study"):
        assert importlib.import_module(f"jaxpf.papers.{name}.{file}").__doc__
    measures, without = found.declared["measures"], found.computed()
    used = {claim.measure for claim in claims_of(name).values() if claim.measure}
    for key, claim in claims_of(name).items():
        assert (claim.measure in measures) != (key in without), key
    for table in found.declared["tables"]:
        columns = [table["measure"]] if "measure" in table else named(table["columns"]).values()
        used |= {column if isinstance(column, str) else column[0] for column in columns}
    assert used == set(measures)
    assert found.declared["scenes"] >= 25
