"""The program's own help."""

import subprocess
import sys

import pytest
from command_line import jaxpf

from jaxpf import cli


def test_help_lists_the_commands():
    text = jaxpf("--help").out
    for command in cli.group.list_commands(None):
        assert f"\n  {command} " in text


def printed_by(program):
    """The last line that a program prints."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version_come_without_heavy_imports(option):
    heavy = "{'jax', 'numpy', 'cv2', 'matplotlib', 'rich'}"
    program = f"import sys; from jaxpf.cli import main; main(['{option}'])"
    assert printed_by(f"{program}; print(sorted({heavy} & set(sys.modules)))") == "[]"
