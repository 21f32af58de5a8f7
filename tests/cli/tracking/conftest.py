"""The clip, and the command on it."""

import pytest
from command_line import jaxpf, refusal_of
from small_video import (
    BOXES,
    LENGTH,
    PARTICLES,
    picture,
    write_images,
    write_lossless_video,
    write_truth,
)


@pytest.fixture(scope="session")
def place(tmp_path_factory):
    """A folder with the clip, as a video and as images, and its truth."""
    folder = tmp_path_factory.mktemp("cli")
    frames = [picture(number) for number in range(LENGTH)]
    write_lossless_video(folder / "clip.avi", frames)
    write_images(folder / "images", frames)
    write_truth(folder / "gt.csv")
    *rows, _ = (folder / "gt.csv").read_text().splitlines()
    (folder / "partial.csv").write_text("\n".join(rows))  # object 2 ends a frame earlier
    return folder


@pytest.fixture(scope="session")
def whole_run(place):
    """One run with everything on: its outcome and its folder."""
    output = place / "nested" / "whole"
    truth = ("--truth", place / "partial.csv")
    outcome = jaxpf("track", place / "clip.avi", *BOXES, *PARTICLES, *truth, "-o", output)
    assert outcome.code == 0, outcome.err
    return outcome, output


@pytest.fixture
def track(place, tmp_path, monkeypatch):
    """Track the clip into ``tmp_path/out``."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments, video=place / "clip.avi"):
        return jaxpf("track", video, *PARTICLES, "-o", tmp_path / "out", *arguments)

    return run


@pytest.fixture
def refuse(place, tmp_path, monkeypatch):
    """Track, and get the one sentence of the refusal; nothing may be left behind."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments, video=place / "clip.avi"):
        sentence = refusal_of("track", video, *PARTICLES, "-o", tmp_path / "out", *arguments)
        assert not (tmp_path / "out").exists()
        return sentence

    return run
