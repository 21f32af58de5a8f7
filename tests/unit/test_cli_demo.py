"""``jaxpf demo``, small."""

import os
import re
import subprocess
import sys

import cv2
import pytest
from command_line import jaxpf

import scenes

#: A second start finds its program kept: neither a tracker nor a filter's stage is traced.
_TOLD_OF_TRACING = """
import sys
from jaxpf import cli, kernel
body = kernel.stage_body
def told(*arguments):
    print("traced")
    return body(*arguments)
kernel.stage_body = told
from jaxpf.experiments import comparison
compare = comparison.compare
def all_told(*arguments):
    results = list(compare(*arguments))
    print("compared")
    return results
comparison.compare = all_told
cli.main(sys.argv[1:])
"""


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    """The folder and what was printed, of a demo and its repetition, in new processes."""
    base, found = tmp_path_factory.mktemp("demos"), []
    environment = os.environ | {"JAXPF_CACHE_DIR": str(base / "cache")}
    repeat = ["--config", str(base / "first" / "run.toml")]
    for name, options in (("first", ["--runs", "3", "-n", "40"]), ("second", repeat)):
        options = [*options, "-o", str(base / name)]
        done = subprocess.run(
            [sys.executable, "-c", _TOLD_OF_TRACING, "demo", *options],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        found.append((base / name, done.stdout))
    return found


def test_it_prints_a_table_and_writes_its_files(demos):
    folder, text = demos[0]
    assert re.search(r"SIR.*%.*\[\d+, \d+\]", text)
    for method in ("SIR", "PS", "DPS", "SPS"):
        assert re.search(rf"│ {method} +│ +\d+ % \[\d+, \d+\] │", text)
    assert (folder / "demo.png").stat().st_size > 10_000
    video = cv2.VideoCapture(str(folder / "overlay.webm"))
    scene = scenes.make("distracter", seed=100)
    frames = 0
    while video.read()[0]:
        frames += 1
    assert frames == scene.num_frames - 1


def test_its_repetition_finds_the_program_and_the_same_results(demos):
    (_, first), (_, second) = demos
    assert "traced" in first.partition("compared")[0]
    assert "traced" not in second.partition("compared")[0]
    tables = [text[text.index("smith2004's") : text.index("│ SPS")] for _, text in demos]
    assert tables[0] == tables[1]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--runs", "0"], "--runs 0 must be at least 1"),
        (["-n", "0"], "--particles 0 must be at least 1"),
        (["--seed", "-1"], "--seed -1 must be between 0 and 1048575"),
    ],
)
def test_bad_options_are_refused(arguments, sentence, tmp_path):
    refused = jaxpf("demo", *arguments, "-o", tmp_path / "demo")
    assert refused.code == 2
    assert sentence in refused.err
