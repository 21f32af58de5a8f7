import os
import subprocess
import sys
import tracemalloc
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numbered_frames import message_of, number_of, numbered_frame

from jaxpf.media import VideoWriter, open_frames
from jaxpf.media.quiet import quiet_opencv

CODECS = {"mp4": "mp4v", "avi": "MJPG"}


def write_video(path, num_frames=40, fps=25.0, frame=numbered_frame, size=(64, 48)):
    if path.suffix == ".webm":
        with av.open(os.path.abspath(path), "w") as container:
            stream: av.VideoStream = container.add_stream("libvpx-vp9", rate=round(fps))
            (stream.width, stream.height), stream.pix_fmt = size, "yuv420p"
            for index in range(num_frames):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(frame(index % 40))))
            container.mux(stream.encode(None))
        return path
    fourcc = cv2.VideoWriter.fourcc(*CODECS[path.suffix[1:]])
    with quiet_opencv():
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, fps, size)
    assert writer.isOpened()
    for index in range(num_frames):
        writer.write(frame(index % 40)[..., ::-1])
    writer.release()
    return path


def noisy_frame(index):
    noise = np.random.default_rng(index).integers(0, 40, (48, 64, 3))
    return (numbered_frame(index) // 2 + noise).astype(np.uint8)


def cut(path, fraction):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * fraction)])
    return path


@pytest.mark.parametrize("suffix", ["mp4", "webm", "avi"])
def test_a_video_gives_its_frames_in_order_as_rgb(tmp_path, suffix):
    source = open_frames(write_video(tmp_path / f"walk.{suffix}", fps=10))
    assert (source.name, source.width, source.height, source.fps) == ("walk", 64, 48, 10.0)
    assert source.frames_expected == 40
    assert source.num_frames is None
    frames = list(source)
    assert [number_of(frame) for frame in frames] == list(range(40))
    assert all(frame.dtype == np.uint8 and frame.shape == (48, 64, 3) for frame in frames)
    red, green, _ = frames[0][24, 4]
    assert red > 180
    assert green < 80
    assert source.num_frames == 40
    assert not source.truncated
    assert source.note is None


def test_a_video_can_be_read_again_and_from_any_frame(tmp_path):
    source = open_frames(write_video(tmp_path / "walk.mp4"))
    assert number_of(next(source.frames(17))) == 17
    assert len(list(source)) == 40
    assert [number_of(frame) for frame in source.frames(start=37)] == [37, 38, 39]


def test_a_given_rate_replaces_that_of_the_container(tmp_path):
    path = write_video(tmp_path / "walk.mp4", 3)
    assert open_frames(path, fps=7).fps == 7
    message = message_of(open_frames, path, 0.0)
    assert "fps 0.0" in message
    assert str(path) in message
    assert "such as 25" in message


def test_start_frames_outside_the_video_are_refused(tmp_path):
    source = open_frames(write_video(tmp_path / "walk.mp4", 5))
    for start in (5, 99, 10**20):
        message = message_of(lambda start=start: next(source.frames(start)))
        assert f"frame {start}" in message
        assert "has 5 frame(s)" in message
        assert "from 0 to 4" in message
    assert "frame -1" in message_of(source.frames, -1)


@pytest.mark.parametrize("suffix", ["avi", "webm"])
def test_a_cut_video_yields_what_decodes_and_says_it_is_truncated(tmp_path, suffix):
    path = cut(write_video(tmp_path / f"walk.{suffix}", frame=noisy_frame), 0.6)
    source = open_frames(path)
    count = len(list(source))
    assert 15 <= count <= 30
    assert source.truncated
    assert source.num_frames == count
    assert str(path) in source.note
    assert f"announces 40 frames, and {count} can be decoded" in source.note
    assert "copy or convert it again" in source.note


def test_a_difference_of_one_or_two_frames_is_a_note_and_no_truncation(tmp_path):
    source = open_frames(write_video(tmp_path / "walk.mp4"))
    source.frames_expected = 41
    list(source)
    assert not source.truncated
    assert "announces 41 frames, and 40 can be decoded" in source.note


def test_frames_are_shown_at_their_timestamps(tmp_path):
    seconds, path = [0.0, 0.1, 0.5, 0.6], tmp_path / "varying.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.max_b_frames = 0
        for number, time in enumerate(seconds):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 40 * number, np.uint8))
            frame.pts, frame.time_base = round(time * 10), Fraction(1, 10)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    source, given = open_frames(path), open_frames(path, fps=5)
    shown = [source.shown_at(number) for number, _ in enumerate(source)]
    np.testing.assert_allclose(shown, seconds)
    given_times = [given.shown_at(number) for number, _ in enumerate(given)]
    np.testing.assert_allclose(given_times, [0, 0.2, 0.4, 0.6])


def test_a_varying_rate_is_not_taken_for_truncation(tmp_path, monkeypatch):
    path = write_video(tmp_path / "walk.webm")
    opencv, rate = cv2.VideoCapture, 2

    class TwentyFrames:
        """Decodes the first 20 of 40 frames, with time stamps of ``rate`` frames each."""

        def __init__(self, path):
            self.decoder, self.count = opencv(path), 0

        def isOpened(self):
            return self.decoder.isOpened()

        def read(self):
            self.count += 1
            return self.decoder.read() if self.count <= 20 else (False, None)

        def get(self, name):
            if name == cv2.CAP_PROP_POS_MSEC:
                return 1000 * (rate * self.count - 1) / 25
            return 40 if name == cv2.CAP_PROP_FRAME_COUNT else self.decoder.get(name)

        def release(self):
            self.decoder.release()

    monkeypatch.setattr(cv2, "VideoCapture", TwentyFrames)
    source = open_frames(path)
    assert len(list(source)) == 20
    assert not source.truncated
    assert "frame rate varies" in source.note
    rate = 1
    source = open_frames(path)
    assert len(list(source)) == 20
    assert source.truncated


def test_a_cut_mp4_without_its_index_is_refused(tmp_path):
    path = cut(write_video(tmp_path / "walk.mp4", frame=noisy_frame), 0.6)
    message = message_of(open_frames, path)
    assert str(path) in message
    assert "begins as MP4 but is cut off" in message
    assert "copy it again" in message


def test_damage_in_the_middle_of_a_video_is_reported(tmp_path):
    path = write_video(tmp_path / "walk.mp4", frame=noisy_frame)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 400] = bytes(400)
    path.write_bytes(data)
    source = open_frames(path)
    count = len(list(source))
    assert count > 0
    assert (source.note is not None) == (count < 40)


def test_a_size_that_changes_on_the_way_is_refused_where_it_does(tmp_path):
    """OpenCV would bring all frames to the first size."""
    parts = []
    for size in ((64, 48), (96, 64)):
        path = tmp_path / f"{size[0]}.ts"
        with av.open(str(path), "w", format="mpegts") as container:
            stream: av.VideoStream = container.add_stream("mpeg2video", rate=25)
            (stream.width, stream.height), stream.pix_fmt = size, "yuv420p"
            for number in range(20):
                picture = np.full((*size[::-1], 3), 10 * number, np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgb24")))
            container.mux(stream.encode(None))
        parts.append(path.read_bytes())
    both = tmp_path / "both.ts"
    both.write_bytes(b"".join(parts))
    frames = open_frames(both).frames()
    assert [next(frames).shape for _ in range(20)] == 20 * [(48, 64, 3)]
    message = message_of(next, frames)
    assert f"'{both}' changes its size at frame 20, from 64x48 to 96x64; convert it" in message


def test_a_codec_that_is_missing_is_named_as_a_cause(tmp_path):
    path = tmp_path / "walk.mp4"
    with VideoWriter(path, 64, 48, 25) as video:
        video.write(numbered_frame(0))
    path.write_bytes(path.read_bytes().replace(b"avc1", b"none").replace(b"avcC", b"nonC"))
    assert "in a codec that OpenCV lacks; copy it again or convert it" in message_of(
        open_frames, path
    )


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("gone.mp4", None, "check the path"),
        ("empty.mp4", b"", "is empty (0 bytes)"),
        ("boxes.txt", b"frame,id,x,y,w,h\n0,1,2,3,4,5\n" * 300, "is a text file"),
        ("umlauts.csv", "größe,".encode() * 2000, "is a text file"),
        ("noise.mp4", bytes(range(256)) * 20, "is not a video that OpenCV can read"),
        ("frame.png", b"\x89PNG\r\n\x1a\n\x00", "is a single image; give the folder"),
    ],
)
def test_what_is_no_video_is_refused_with_a_remedy(tmp_path, name, content, expected):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    message = message_of(open_frames, path)
    assert str(path) in message
    assert expected in message


def test_no_name_is_not_the_folder_one_stands_in():
    assert "no video is named" in message_of(open_frames, "")


def test_memory_does_not_grow_with_the_length(tmp_path):
    def peak(num_frames):
        source = open_frames(write_video(tmp_path / "long.avi", num_frames))
        tracemalloc.start()
        for _ in source:
            pass
        result = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return result

    one_frame = 64 * 48 * 3
    assert one_frame < peak(50) < peak(10) + 2 * one_frame


def test_nothing_is_printed_and_the_log_level_is_put_back(tmp_path):
    write_video(tmp_path / "good.webm", 3)
    cut(write_video(tmp_path / "bad.mp4", frame=noisy_frame), 0.5)
    program = (
        "import os, sys, cv2, numpy as np; from jaxpf.media import open_frames\n"
        "from jaxpf.media import VideoWriter\n"
        "log = cv2 if hasattr(cv2, 'getLogLevel') else cv2.utils.logging\n"
        "level = log.getLogLevel()\n"
        "list(open_frames('good.webm'))\n"
        "try: open_frames('bad.mp4')\n"
        "except ValueError: pass\n"
        "with VideoWriter('out.mp4', 64, 48, 25) as w: w.write(np.zeros((48, 64, 3), np.uint8))\n"
        "assert log.getLogLevel() == level\n"
        "assert 'OPENCV_FFMPEG_LOGLEVEL' not in os.environ\n"
        "assert 'jax' not in sys.modules\n"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OPENCV_FFMPEG_LOGLEVEL"}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("suffix", ["avi", "webm"])
def test_a_colon_in_a_relative_name_is_no_protocol(tmp_path, monkeypatch, suffix):
    monkeypatch.chdir(tmp_path)
    write_video(
        Path(f"part:one.{suffix}") if suffix == "webm" else tmp_path / f"part:one.{suffix}", 4
    )
    assert len(list(open_frames(f"part:one.{suffix}"))) == 4


@pytest.mark.parametrize("name", [b"\xff.avi", b"\xff"])
def test_a_name_that_is_not_utf_8_is_refused(tmp_path, name):
    place = tmp_path / os.fsdecode(name)
    if place.suffix:
        write_video(tmp_path / "a.avi", 2).rename(place)
    else:
        place.mkdir()
    message = message_of(open_frames, place)
    assert "\\udcff" in message
    assert "is not UTF-8; rename" in message
