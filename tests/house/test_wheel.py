"""The wheel of a clean copy holds every file of the packages, and runs in an empty environment."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("jaxpf", "scenes")
#: The installed library is imported, not the clone.
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}


def run(folder, *command):
    """What a command prints that ends well."""
    done = subprocess.run(
        command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}\n{done.stderr[-3000:]}"
    return done.stdout


@pytest.mark.slow
@pytest.mark.always
def test_a_wheel_runs_in_an_empty_environment(tmp_path):
    copy = tmp_path / "copy"
    for name in PACKAGES:
        without = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, copy / name, ignore=without)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    files = {path.relative_to(copy).as_posix() for path in copy.rglob("*") if path.is_file()}
    files = {name for name in files if name.startswith(PACKAGES)}

    run(copy, sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", tmp_path, ".")
    (wheel,) = tmp_path.glob("*.whl")
    missing = files - set(zipfile.ZipFile(wheel).namelist())
    assert not missing

    run(tmp_path, sys.executable, "-m", "venv", "empty")
    programs = tmp_path / "empty" / "bin"
    versions = ("-c", ROOT / "constraints.txt")
    run(tmp_path, programs / "python", "-m", "pip", "install", "-q", *versions, f"{wheel}[cli]")
    where = run(tmp_path, programs / "python", "-c", "import jaxpf; print(jaxpf.__file__)")
    assert Path(where.strip()).is_relative_to(tmp_path / "empty")
    assert "--runs" in run(tmp_path, programs / "jaxpf", "demo", "--help")
    printed = run(tmp_path, programs / "jaxpf", "demo", "--runs", "1", "-n", "20", "-o", "out")
    assert "DPS" in printed
    assert (tmp_path / "out" / "overlay.mp4").is_file()
