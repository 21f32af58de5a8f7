import os
import subprocess
import sys
from fractions import Fraction

import av
import numpy as np
import pytest
from numbered_frames import number_of, numbered_frame
from refusals import message_of

from jaxpf.media import VideoWriter, open_frames


@pytest.mark.parametrize(("width", "height"), [(64, 48), (65, 47)])
def test_a_written_video_plays_back(tmp_path, width, height):
    path = tmp_path / "out.mp4"
    with VideoWriter(path, width, height, 12.5) as writer:
        for index in range(12):
            writer.write(numbered_frame(index, width, height))
    assert os.listdir(tmp_path) == ["out.mp4"]
    source = open_frames(path)
    assert (source.width, source.height, source.fps) == (
        width + width % 2,
        height + height % 2,
        12.5,
    )
    frames = list(source)
    assert [number_of(frame) for frame in frames] == list(range(12))
    assert np.abs(frames[11][20, 5].astype(int) - (220, 30, 30)).max() < 6, "colours stay"
    assert frames[11][-1, 0, 0] > 180, "the last row repeats the one above it"
    assert abs(int(frames[11][10, -1, 0]) - 76) < 12, "so does the last column"


def test_a_video_is_of_the_kind_that_every_player_shows(tmp_path):
    with VideoWriter(tmp_path / "out.mp4", 65, 47, 25) as writer:
        writer.write(numbered_frame(0, 65, 47))
    with av.open(str(tmp_path / "out.mp4")) as container:
        context = container.streams.video[0].codec_context
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")
        assert (context.colorspace, context.color_range) == (6, 1), "BT.601, 16 to 235"


def test_frames_are_shown_when_and_as_wide_as_asked(tmp_path):
    times = [0, 0.033, 0.067, 60.0, 60.0, 60.04]
    with VideoWriter(tmp_path / "out.mp4", 64, 48, 25, Fraction(16, 15)) as writer:
        for number, time in enumerate(times):
            writer.write(numbered_frame(number), time)
    source = open_frames(tmp_path / "out.mp4")
    shown = [source.shown_at(number) for number, _ in enumerate(source)]
    np.testing.assert_allclose(shown, times, atol=2e-5)
    assert source.pixel_aspect == Fraction(16, 15)
    with av.open(str(tmp_path / "out.mp4")) as container:
        assert container.duration == pytest.approx(60.08e6, abs=100)


def run_program(folder, program):
    """What another process prints as an error."""
    given = {"cwd": folder, "capture_output": True, "text": True, "timeout": 500}
    return subprocess.run([sys.executable, "-c", program], **given).stderr


def test_a_killed_writer_leaves_a_playable_video(tmp_path):
    program = (
        "import os, numpy as np; from jaxpf.media import VideoWriter\n"
        "writer = VideoWriter('out.mp4', 64, 48, 25)\n"
        "for n in range(40): writer.write(np.full((48, 64, 3), 5 * n, np.uint8))\n"
        "os.kill(os.getpid(), 9)\n"
    )
    assert run_program(tmp_path, program) == ""
    assert os.listdir(tmp_path) == ["out.mp4"]
    levels = [frame[0, 0, 0] for frame in open_frames(tmp_path / "out.mp4")]
    assert 20 < len(levels) <= 40
    np.testing.assert_allclose(levels, 5 * np.arange(len(levels)), atol=2)


def test_an_earlier_video_is_replaced_by_the_first_frame(tmp_path):
    (tmp_path / "out.mp4").write_bytes(b"earlier")
    with VideoWriter(tmp_path / "out.mp4", 64, 48, 25):
        pass
    assert (tmp_path / "out.mp4").read_bytes() == b"earlier"
    with open(tmp_path / "out.mp4", "rb") as reader:
        with VideoWriter(tmp_path / "out.mp4", 64, 48, 25) as writer:
            writer.write(numbered_frame(0))
            assert os.listdir(tmp_path) == ["out.mp4"]
        assert reader.read() == b"earlier", "whoever reads it, as to rewrite it, can go on"
    assert len(list(open_frames(tmp_path / "out.mp4"))) == 1


def test_a_frame_may_be_changed_once_it_is_written(tmp_path):
    frame = numbered_frame(0)
    with VideoWriter(tmp_path / "out.mp4", 64, 48, 25) as writer:
        for index in range(30):
            frame[:] = numbered_frame(index)
            writer.write(frame)
    found = [number_of(frame) for frame in open_frames(tmp_path / "out.mp4")]
    assert found == list(range(30))


def test_a_writer_without_frames_leaves_nothing_and_closes_twice(tmp_path):
    with VideoWriter(tmp_path / "out.mp4", 64, 48, 25) as writer:
        pass
    writer.close()
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
def test_a_full_disk_is_one_sentence_and_leaves_no_half_video(tmp_path):
    program = (
        "import resource, numpy as np; from jaxpf.media import VideoWriter\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "rng = np.random.default_rng(0)\n"
        "with VideoWriter('out.mp4', 64, 48, 25) as writer:\n"
        "    for _ in range(60): writer.write(rng.integers(0, 255, (48, 64, 3)).astype(np.uint8))\n"
    )
    errors = run_program(tmp_path, program)
    assert "InputError: cannot write video 'out.mp4': file too large" in errors
    assert "check the free disk space" in errors
    assert os.listdir(tmp_path) == []


def test_an_encoder_that_fails_stops_the_writing(tmp_path, monkeypatch):
    def failing(*_):
        raise OSError(5, "Input/output error")

    writer = VideoWriter(tmp_path / "out.mp4", 64, 48, 25)
    monkeypatch.setattr(av.VideoFrame, "from_ndarray", failing)

    message = message_of(writer.write, numbered_frame(0))
    assert "'out.mp4': input/output error" in message.replace(f"{tmp_path}/", "")
    assert "input/output error" in message_of(writer.close)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(("encoder", "size"), [("gone", (64, 48)), ("libx264", (70_000, 48))])
def test_an_encoder_that_is_missing_or_refuses_is_found_at_once(
    tmp_path, monkeypatch, encoder, size
):
    monkeypatch.setattr("jaxpf.media.video_writer._ENCODER", encoder)
    message = message_of(VideoWriter, tmp_path / "out.mp4", *size, 25)
    assert f"the encoder {encoder} is missing or refuses frames of {size[0]}x{size[1]}" in message
    assert os.listdir(tmp_path) == []
