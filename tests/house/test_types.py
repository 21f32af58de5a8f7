"""A type checker refuses options and values that do not exist."""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def test_a_type_checker_refuses_each_mistake_and_nothing_else():
    ran = subprocess.run(
        [sys.executable, "-m", "mypy", "--no-error-summary", HERE / "mistakes.py"],
        cwd=HERE.parents[1],
        capture_output=True,
        text=True,
    )
    found = {int(line.split(":")[1]) for line in ran.stdout.splitlines() if ": error:" in line}
    lines = (HERE / "mistakes.py").read_text().splitlines()
    assert found == {n for n, line in enumerate(lines, 1) if line.endswith("# mistake")}, ran.stdout
