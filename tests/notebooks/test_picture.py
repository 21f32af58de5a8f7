"""Pictures are those of the present code, and README's bands those that the program prints."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

pytestmark = pytest.mark.compiled_as_by_users

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "notebooks" / "docs" / "picture.py"
REMAKE = f"look at it after `python {PROGRAM.relative_to(ROOT)}`"


@pytest.fixture(scope="module")
def program():
    specification = importlib.util.spec_from_file_location("picture", PROGRAM)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def widths(path):
    """The widths of a picture's bands in pixels."""
    return [int(x) for x in Image.open(path).text["Median widths in pixels"].split()]


def test_readme_has_no_other_picture(program):
    shown = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", (ROOT / "README.md").read_text())
    assert [ROOT / name for name in shown] == [program.PICTURE]


@pytest.mark.parametrize(("name", "code"), [("PICTURE", "DRAWN_BY"), ("REVIEW", "PAGE")])
def test_a_picture_was_drawn_by_the_present_code(program, name, code):
    drawn_by = Image.open(getattr(program, name)).text["Drawn by"]
    assert drawn_by == program.digest(getattr(program, code)), REMAKE


@pytest.mark.slow
def test_the_picture_shows_the_bands_that_the_program_prints(program, tmp_path):
    for command in program.COMMANDS:
        done = subprocess.run(
            [sys.executable, "-m", "jaxpf", *command.split()],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
    printed = [int(x) for x in re.findall(r"(\d+) pixels wide along x", done.stdout)]
    assert len(printed) == 3
    # Other machines round otherwise.
    assert widths(program.PICTURE) == pytest.approx(printed, abs=2), REMAKE
    program.draw(tmp_path / "street" / "tracks", tmp_path / "new.png")
    assert widths(tmp_path / "new.png") == pytest.approx(printed, abs=1)
