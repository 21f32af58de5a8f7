"""What is too much is refused at once: memory, processes, names, numbers."""

import pytest
from command_line import jaxpf
from small_sequence_folder import SMALL

from jaxpf import InputError
from jaxpf.evaluation import Plan
from jaxpf.running import memory

LONG = "x" * 300


def refused(*arguments):
    """The one sentence."""
    outcome = jaxpf(*arguments)
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    *_, sentence = outcome.err.strip().splitlines()
    assert sentence.startswith("Error: ")
    assert len(sentence) < 700
    return sentence


def test_more_memory_than_there_is_is_refused_with_both_sums(monkeypatch):
    monkeypatch.setattr(memory, "machine_memory", lambda: 8 * 2**30)
    with pytest.raises(InputError) as caught:
        memory.check_memory(9.5 * 2**30, "ask for less")
    assert str(caught.value) == (
        "this takes about 9.5 GB of memory, and this machine has 8.0 GB; ask for less."
    )
    memory.check_memory(7.5 * 2**30, "ask for less")


def test_a_machine_tells_its_memory():
    assert 2**28 < memory.machine_memory() < 2**50


def test_an_evaluation_that_does_not_fit_is_refused_also_where_it_is_only_planned(tmp_path):
    options = ("--methods", "sir", "-n", "100000000", "--likelihood", "integral", "--runs", "25")
    sentence = refused("evaluate", "distracter", *options, "--dry-run", "-o", tmp_path / "o")
    assert "GB of memory, and this machine has" in sentence
    assert not (tmp_path / "o").exists()


def test_a_demo_and_a_tuning_that_do_not_fit_are_refused(tmp_path):
    tune = ("tune", "distracter", *SMALL, "--train-scenes", "1")
    for command in (("demo",), tune):
        sentence = refused(*command, "-n", "500000000", "-o", tmp_path / "o")
        assert "GB of memory, and this machine has" in sentence
        assert "fewer particles (-n)" in sentence
        assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(("flag", "value"), [("devices", 10000), ("workers", 100000)])
def test_processes_and_devices_are_bounded(flag, value):
    sentence = refused("evaluate", "distracter", f"--{flag}", value)
    assert f"--{flag} {value} must be a whole number from 1 to 256." in sentence


@pytest.mark.parametrize("command", ["evaluate", "tune"])
def test_a_folder_whose_name_is_too_long_is_refused(command):
    assert "file name too long" in refused(command, "distracter", "-o", LONG)
    assert "file name too long" in refused(command, "distracter", "--config", LONG)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[evaluate]\nruns = " + "[" * 20_000, "is nested too deeply"),
        ("[evaluate]\nruns = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
        ("[evaluate]\nruns = " + "9" * 400, "9999 must be a whole number"),
        ('[evaluate]\noutput = "a\\u0000b"', "holds a NUL"),
        ("[evaluate]\nruns = '" + "y" * 5000 + "'", "[evaluate]: 'yyyy"),
    ],
)
def test_a_hostile_configuration_is_refused(tmp_path, text, said):
    (tmp_path / "c.toml").write_text(text)
    assert said in refused("evaluate", "distracter", "--config", tmp_path / "c.toml")


def test_a_demo_replaces_nothing_unasked(tmp_path):
    (tmp_path / "mine.txt").touch()
    sentence = refused("demo", "--runs", 1, "-n", 20, "-o", tmp_path)
    assert "is not empty (it holds 'mine.txt')" in sentence
    assert "--overwrite" in sentence


@pytest.mark.parametrize("name", ["two\nlines", "x" * 101, "bell\a"])
def test_a_trackers_name_fits_a_table(name):
    with pytest.raises(InputError, match="a tracker cannot be called"):
        Plan("distracter", methods=(), tracks={name: "file.csv"})


@pytest.mark.parametrize("kind", ["scene", "tracker", "import"])
def test_a_users_function_that_fails_is_told_by_file_and_line(tmp_path, kind):
    path = tmp_path / "mine.py"
    body = "def scene(seed=0):\n    return 1 / 0\n\n\n"
    body += "def tracker(scene):\n    raise ValueError('[/red]')\n"
    path.write_text("\n1 / 0\n" if kind == "import" else body)
    scene = (
        ("distracter", "--tracker", f"{path}:tracker") if kind == "tracker" else (f"{path}:scene",)
    )
    sentence = refused("evaluate", *scene, "-o", tmp_path / "o")
    said = {
        "scene": "failed with ZeroDivisionError: division by zero, at line 2 of",
        "tracker": "failed with ValueError: [/red], at line 6 of",
        "import": "cannot be imported (ZeroDivisionError: division by zero, at line 2 of",
    }
    assert said[kind] in sentence


@pytest.mark.parametrize(
    "arguments",
    [
        ("track", "clip.mp4", "-o", ""),
        ("track", "clip.mp4", "--births", ""),
        ("example", "boxes", ""),
        ("export", "", "mot", "a.txt"),
        ("contour", "learn", ""),
        ("reproduce", "rowe2005", "-o", ""),
        ("demo", "-o", ""),
        ("evaluate", "", "--dry-run"),
        ("tune", ""),
        ("evaluate", "distracter", "--dask", ""),
        ("evaluate", "distracter", "--target", ""),
        ("tune", "distracter", "--parameters", ""),
        ("track", "clip.mp4", "--tracker", ""),
    ],
)
def test_an_empty_path_is_not_this_folder(arguments, tmp_path, monkeypatch):
    """Such as of a variable of the shell that is not set: nothing is read or written there."""
    monkeypatch.chdir(tmp_path)
    assert "is empty; give a" in refused(*arguments)
    assert not list(tmp_path.iterdir())
