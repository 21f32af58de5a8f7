"""Commands of README and site run as pasted, in their order, in an empty folder."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import click
import pytest

from jaxpf.cli import group

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "notebooks" / "docs"
#: Page -> what its commands leave behind.
PAGES = {
    ROOT / "README.md": {"street", "jaxpf-clip", "out.mp4"},
    SITE / "start.md": {
        *("street", "two", "puppet", "fish", "wires", "crossing"),
        *("points", "parts", "contours"),
    },
    SITE / "own.md": set(),
}
#: How a line begins that is not run, and why.
LEFT_OUT = {
    ".venv/bin/pip": "installs into the clone, and builds the site",
    "python3 -m venv": "installs into a clone of its own",
    ".venv/bin/python -m pytest": "is the test command",
    "dask scheduler": "leaves programs running",
    "jaxpf evaluate": "takes minutes, or reads files of the clone",
    "jaxpf reproduce": "takes minutes",
    "python tests/benchmarks": "takes minutes",
}


def commands(page):
    """(language, program) of every line of shell, and of every block of Python."""
    for language, block in re.findall(r"```(sh|python)\n(.*?)```", page.read_text(), re.DOTALL):
        programs = block.splitlines() if language == "sh" else [block]
        yield from ((language, program) for program in programs)


def test_what_is_left_out_is_there():
    pages = [ROOT / "README.md", *SITE.rglob("*.md")]
    lines = {page: [p for language, p in commands(page) if language == "sh"] for page in pages}
    for beginning in LEFT_OUT:
        given = (line for those in lines.values() for line in those)
        assert any(line.startswith(beginning) for line in given), beginning
    for page in set(pages) - PAGES.keys():  # pages that are not run give such commands only
        assert all(line.startswith(tuple(LEFT_OUT)) for line in lines[page]), page


def flags(command):
    """Every option of a command and of its subcommands."""
    if isinstance(command, click.Group):
        for name in command.list_commands(None):
            yield from flags(command.get_command(None, name))
    for parameter in command.params:
        yield from (*parameter.opts, *parameter.secondary_opts)


def test_commands_on_films_of_the_readers_own_have_the_options_that_they_show():
    known, shown = {*flags(group)}, set()
    for page in SITE.rglob("*.md"):
        for line in re.findall(r"^ *\$ jaxpf (.*)$", page.read_text(), re.MULTILINE):
            name, *words = line.split()
            assert name in group.list_commands(None), f"{page.name}: {line}"
            shown |= {word for word in words if re.match(r"--?[a-z]", word)}
    assert shown
    assert shown <= known, shown - known


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_commands_run(page, tmp_path):
    programs, folder = tmp_path / "bin", tmp_path / "empty"
    programs.mkdir()
    folder.mkdir()
    jaxpf = programs / "jaxpf"
    jaxpf.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m jaxpf "$@"\n')
    jaxpf.chmod(jaxpf.stat().st_mode | stat.S_IXUSR)
    environment = os.environ | {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    for language, program in commands(page):
        if language == "sh" and program.startswith(tuple(LEFT_OUT)):
            continue
        shell = ["bash", "-c"] if language == "sh" else [sys.executable, "-c"]
        done = subprocess.run(
            [*shell, program], cwd=folder, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{program}\n{done.stderr[-2000:]}"
    written = {path.name for path in folder.iterdir()}
    assert PAGES[page] <= written
