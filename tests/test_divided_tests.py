"""Which slow tests a run of the checks takes, and that it ends in time."""

import os
import subprocess
import sys
from pathlib import Path

import divided_tests
import pytest
from divided_tests import chosen, cut, touched

NAMES = [f"tests/{room}/test_it.py::test_{n}" for room in ("boxes", "media") for n in range(15)]
NAMES += [f"tests/running/test_it.py::test_wide[{n}]" for n in range(60)]


def test_six_numbers_in_a_row_run_every_test_once():
    parts = [chosen(NAMES, (), number)[0] for number in range(7, 13)]
    assert sorted(name for part in parts for name in part) == sorted(NAMES)
    assert all(parts)
    assert chosen(NAMES, (), 13)[0] == parts[0]


def test_changed_code_is_tested_after_the_sixth():
    sixth, changed = chosen(NAMES, ("tests/boxes/",), 1)
    assert changed == [name for name in NAMES[:15] if name not in sixth]


@pytest.mark.parametrize(("place", "number"), [("{}.py::test", 9), ("it.py::test_{}", 12)])
def test_tests_of_a_file_stay_together_and_in_a_large_one_those_of_a_function(place, number):
    groups = [[f"{place.format(name)}[{n}]" for n in range(number)] for name in "abcdef"]
    names = [name for group in groups for name in group]
    for sixth in range(6):
        part = {*chosen(names, (), sixth)[0]}
        assert all(part.issuperset(group) or part.isdisjoint(group) for group in groups)


def test_every_worker_begins_with_its_part():
    assert [cut("abcdefg", n, 3) for n in range(3)] == ["ab", "cd", "efg"]


def test_rooms_select_their_tests():
    assert set(touched(["jaxpf/boxes/factory.py", "README.md"])) == {"tests/boxes/"}
    assert set(touched(["jaxpf/cli/tracking/writing.py"])) == {"tests/cli/tracking/"}
    assert set(touched(["jaxpf/media/x.py", "tests/cli/test_x.py", "scenes/fish.py"])) == {
        *("tests/media/", "tests/cli/test_x.py", "tests/scenes/"),
    }
    assert set(touched(["jaxpf/evaluation/engine.py"])) == {"tests/evaluation/"}
    assert set(touched(["jaxpf/ordering.py"])) == {"tests/filters/", "tests/statistical/"}
    kernel = {"tests/filters/", "tests/statistical/"}
    assert set(touched(["jaxpf/lowering/sums.py"])) == {*kernel, "tests/lowering/"}
    assert set(touched(["jaxpf/filters/partitioned/x.py"])) == {
        *kernel,
        "tests/filters/partitioned/",
    }
    assert touched(["constraints.txt"]) == ("tests/",)
    assert "tests/test_divided_tests.py" in touched(["tests/helpers/divided_tests.py"])


def started(folder, *options):
    """What pytest prints for the tests of a folder, divided; all that ran have passed."""
    command = [sys.executable, "-m", "pytest", "-pdivided_tests", "-pno:cacheprovider", *options]
    path = {"PYTHONPATH": str(Path(divided_tests.__file__).parent)}
    done = subprocess.run(
        command, cwd=folder, env=os.environ | path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.slow
@pytest.mark.always
def test_pytest_takes_a_sixth_and_begins_no_test_after_the_time(tmp_path):
    """Of 60 tests some are chosen; the first lets the time end while it runs."""
    one = f"def test_{{}}():\n    os.environ['{divided_tests.UNTIL}'] = '1'\n\n"
    (tmp_path / "test_it.py").write_text("import os\n" + "".join(map(one.format, range(60))))
    said = started(tmp_path, "-n1", "--sixth=4")
    number = len(chosen([f"test_it.py::test_{n}" for n in range(60)], (), 4)[0])
    assert said.count("NOT RUN test_it.py::test_") == number - 1
    assert f"1 passed, {number - 1} not run" in said


def test_a_sixth_begins_with_tests_that_always_run(tmp_path):
    marked = "@pytest.mark.always\ndef test_marked():\n    pass\n\n"
    others = "".join(f"def test_{n}():\n    pass\n\n" for n in range(30))
    (tmp_path / "test_it.py").write_text(f"import pytest\n\n{others}{marked}")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    always: in every sixth\n")
    for sixth in (0, 1):
        said = started(tmp_path, "-v", f"--sixth={sixth}")
        ran = [line.split()[0] for line in said.splitlines() if " PASSED" in line]
        assert ran[0] == "test_it.py::test_marked"
        assert len(ran) < 31
