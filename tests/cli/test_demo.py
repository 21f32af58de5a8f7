"""``jaxpf demo``, small."""

import re

import pytest
from command_line import jaxpf

import scenes
from jaxpf.media import open_frames


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
def test_it_prints_a_table_with_each_methods_own_time_and_writes_its_files(demos):
    folder, text = demos[0]
    assert len(re.findall(r"of the runs \([\d.]+ s\)", text)) == 4
    assert "success: tracked in every frame" in text
    assert re.search(r"SIR.*%.*\[\d+, \d+\]", text)
    for method in ("SIR", "PS", "DPS", "SPS"):
        assert re.search(rf"│ {method} +│ +\d+% \[\d+, \d+\] │", text)
    frames = sum(1 for _ in open_frames(folder / "overlay.mp4"))
    assert frames == scenes.make("distracter", seed=100).num_frames - 1


@pytest.mark.slow
def test_its_repetition_finds_the_same_results(demos):
    tables = [text[text.index("smith2004's") : text.index("│ SPS")] for _, text in demos]
    assert tables[0] == tables[1]
