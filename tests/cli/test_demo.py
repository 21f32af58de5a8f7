"""``jaxpf demo``, small."""

import re

import cv2
import pytest
from command_line import jaxpf

import scenes


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    """The folders of a demo and of its repetition, with what was printed."""
    base, results = tmp_path_factory.mktemp("demos"), []
    for name in ("first", "second"):
        done = jaxpf("demo", "--runs", "3", "-n", "40", "-o", base / name)
        assert done.code == 0, done.err
        results.append((base / name, done.out))
    return results


@pytest.mark.slow
def test_it_prints_a_table_and_writes_its_files(demos):
    folder, text = demos[0]
    assert re.search(r"SIR.*%.*\[\d+, \d+\]", text)
    for method in ("SIR", "PS", "DPS", "SPS"):
        assert re.search(rf"│ {method} +│ +\d+ % \[\d+, \d+\] │", text)
    video = cv2.VideoCapture(str(folder / "overlay.mp4"))
    scene = scenes.make("distracter", seed=100)
    frames = 0
    while video.read()[0]:
        frames += 1
    assert frames == scene.num_frames - 1


@pytest.mark.slow
def test_its_repetition_finds_the_same_results(demos):
    tables = [text[text.index("smith2004's") : text.index("│ SPS")] for _, text in demos]
    assert tables[0] == tables[1]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--runs", "0"], "Invalid value for '--runs': 0 is not in the range 1<=x<=100000"),
        (["--runs", "9" * 20], "is not in the range 1<=x<=100000"),
        (["-n", "0"], "--particles 0 must be a whole number from 1"),
        (["--seed", "-1"], "Invalid value for '--seed': -1 is not in the range 0<=x<=1048575"),
    ],
)
def test_bad_options_are_refused(arguments, sentence, tmp_path):
    refused = jaxpf("demo", *arguments, "-o", tmp_path / "demo")
    assert refused.code == 2
    assert sentence in refused.err
