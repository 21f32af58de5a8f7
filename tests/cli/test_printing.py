"""What is printed controls no terminal, and ends in one sentence where it cannot be printed."""

import os
import subprocess
import sys

import pytest
from command_line import jaxpf

from jaxpf.cli.shared.console import print_table, visible

COMMAND = f"{sys.executable} -m jaxpf.cli"
FULL = "Error: cannot write the output: no space left"
#: Escape codes, a bell, one control byte that begins a code, and marks that reverse the text.
HOSTILE = "a\x1b[31mred\x07\x9b2J\u202egnp.exe\r"


def test_controls_are_escaped_and_other_text_stays(capsys):
    for text in ("größe\tein\nzwei", "می‌خواهم", "👩‍🔬", "a\\x1b"):
        assert visible(text) == text
    shown = r"a\x1b[31mred\x07\x9b2J\u202egnp.exe\r"
    assert visible(HOSTILE) == shown
    assert visible("\udcff") == r"\udcff"
    print_table(HOSTILE, [HOSTILE], [[HOSTILE]])
    assert capsys.readouterr().out.count(shown) == 3


@pytest.mark.parametrize(
    "arguments",
    [
        ("track", HOSTILE, "--box", "1,1,5,5"),
        ("track", "clip.mp4", f"--{HOSTILE}"),
        ("export", ".", HOSTILE, "x.json"),
        ("evaluate", HOSTILE),
        (HOSTILE,),
        ("export", "a\nError: all is lost", "coco", "x.json"),
        ("trakc",),
        ("mark", "--strat", "1"),
    ],
)
def test_names_on_the_command_line_reach_no_terminal_and_are_one_line(
    arguments, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    outcome = jaxpf(*arguments)
    assert outcome.code == 2
    assert (r"a\x1b[31mred" in outcome.err) == (HOSTILE in "".join(arguments))
    assert visible(outcome.err) == outcome.err
    assert outcome.err.partition("Error: ")[2].count("\n") == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="devices and a shell of Linux")
@pytest.mark.parametrize(
    ("line", "code", "sentence"),
    [
        ("verdicts | head -1", 0, ""),
        pytest.param("--help | true", 0, "", marks=pytest.mark.slow),
        ("verdicts >&-", 2, "Error: standard output "),
        ("verdicts 1</dev/null", 2, "Error: cannot write the output"),
        *((f"{words} > /dev/full", 2, FULL) for words in ("--help", "verdicts")),
        ("export . coco x.json 2>&-", 2, ""),
    ],
)
def test_an_output_that_is_closed_or_full_is_no_traceback(line, code, sentence, tmp_path):
    command = f"set -o pipefail; {COMMAND} {line}"
    ended = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=tmp_path)
    assert ended.returncode == code
    assert ended.stderr.startswith(sentence)
    assert ended.stderr.count("\n") == bool(sentence)
