"""What is too much is refused at once: processes, names, numbers."""

import pytest
from command_line import refusal_of

LONG = "x" * 300


def refused(*arguments):
    sentence = refusal_of(*arguments)
    assert len(sentence) < 700
    return sentence


@pytest.mark.parametrize("command", ["evaluate", "tune"])
def test_a_folder_whose_name_is_too_long_is_refused(command):
    assert "file name too long" in refused(command, "distracter", "-o", LONG)
    assert "file name too long" in refused(command, "distracter", "--config", LONG)


@pytest.mark.parametrize("command", ["demo --runs 1 -n 20 -o", "example boxes"])
def test_results_replace_nothing_unasked(tmp_path, command):
    (tmp_path / "mine.txt").touch()
    sentence = refused(*command.split(), tmp_path)
    assert "is not empty (it holds 'mine.txt')" in sentence
    assert "--overwrite" in sentence


BODY = "def scene(seed=0):\n    return 1 / 0\n\ndef tracker(scene):\n    raise ValueError('[/red]')"


@pytest.mark.parametrize(
    ("body", "arguments", "named"),
    [
        (BODY, "{}:scene", ("ZeroDivisionError", "line 2")),
        (BODY, "distracter --tracker {}:tracker", ("ValueError: [/red]", "line 5")),
        ("\n1 / 0", "{}:scene", ("ZeroDivisionError", "line 2")),
    ],
)
def test_a_users_function_that_fails_is_told_by_file_and_line(tmp_path, body, arguments, named):
    (tmp_path / "mine.py").write_text(body)
    words = arguments.format(tmp_path / "mine.py").split()
    sentence = refused("evaluate", *words, "-o", tmp_path / "o")
    assert all(word in sentence for word in (*named, "mine.py"))


EMPTY = """track clip.mp4 -o {0}
track clip.mp4 --detections {0}
track clip.mp4 --tracker {0}
example boxes {0}
export {0} mot a.txt
contour learn {0}
reproduce rowe2005 -o {0}
evaluate {0} --dry-run
evaluate distracter --dask {0}
tune {0}
tune distracter --parameters {0}"""


@pytest.mark.parametrize("words", EMPTY.splitlines())
def test_an_empty_path_is_not_this_folder(words, tmp_path, monkeypatch):
    """Such as of a variable of the shell that is not set: nothing is read or written there."""
    monkeypatch.chdir(tmp_path)
    assert "is empty" in refused(*(word.format("") for word in words.split()))
    assert not list(tmp_path.iterdir())
