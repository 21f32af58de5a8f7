"""README's commands run as pasted, in the order in which they stand there, in an empty folder."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).resolve().parents[2] / "README.md").read_text()
BLOCKS = re.findall(r"```(sh|python)\n(.*?)```", README, re.DOTALL)
#: How a line begins that is not run, and why.
LEFT_OUT = {
    ".venv/bin/pip": "installs into the clone, and builds the site",
    "python3 -m venv": "installs into a clone of its own",
    ".venv/bin/python -m pytest": "is the test command",
    "jaxpf evaluate": "takes minutes, or reads files of the clone",
    "jaxpf reproduce": "takes minutes",
}


def commands():
    """(language, program) of every line of shell, and of every block of Python."""
    for language, block in BLOCKS:
        programs = block.splitlines() if language == "sh" else [block]
        yield from ((language, program) for program in programs)


def test_what_is_left_out_is_there():
    lines = [program for language, program in commands() if language == "sh"]
    for beginning in LEFT_OUT:
        assert any(line.startswith(beginning) for line in lines), beginning


@pytest.mark.slow
def test_the_commands_run(tmp_path):
    programs, folder = tmp_path / "bin", tmp_path / "empty"
    programs.mkdir()
    folder.mkdir()
    jaxpf = programs / "jaxpf"
    jaxpf.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m jaxpf "$@"\n')
    jaxpf.chmod(jaxpf.stat().st_mode | stat.S_IXUSR)
    # Compiling is most of the work.
    quickly = {"JAX_DISABLE_MOST_OPTIMIZATIONS": "1"}
    environment = os.environ | quickly | {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    for language, program in commands():
        if language == "sh" and program.startswith(tuple(LEFT_OUT)):
            continue
        shell = ["bash", "-c"] if language == "sh" else [sys.executable, "-c"]
        done = subprocess.run(
            [*shell, program], cwd=folder, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{program}\n{done.stderr[-2000:]}"
    written = {path.name for path in folder.iterdir()}
    assert {"clip-frame-0.png", "jaxpf-clip", "points", "parts", "contours", "out.mp4"} <= written
