"""Outputs of runs whose video is gone, and their exports."""

import json

import pytest
from command_line import jaxpf


@pytest.fixture
def result(tmp_path):
    """A function that makes the output folder of a target's tracks."""
    folder = tmp_path / "result"
    folder.mkdir()

    def make(target, tracks, outlines=None, start=0, times=(0.0, 0.04), pictures=None):
        (folder / "tracks.csv").write_text(tracks)
        if outlines is not None:
            (folder / "outlines.csv").write_bytes(outlines)
        about = {
            "parameters": {"target": target, "video": "gone/clip.mp4", "start": start},
            "width": 60,
            "height": 40,
            "times": list(times),
            "pictures": pictures,
        }
        (folder / "summary.json").write_text(json.dumps(about))
        return folder

    return make


@pytest.fixture
def exported():
    """A function that exports a folder's tracks to a file of that name in it."""

    def run(folder, form, name):
        outcome = jaxpf("export", folder, form, folder / name)
        assert outcome.code == 0, outcome.err
        return folder / name

    return run
