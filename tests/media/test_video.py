import struct
import subprocess
import sys
import tracemalloc
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from films import moving_square, write_film
from numbered_frames import number_of, numbered_frame
from refusals import message_of

from jaxpf.media import VideoWriter, open_frames

CODECS = {
    ".mp4": ("libx264", "yuv420p"),
    ".avi": ("mjpeg", "yuvj420p"),
    ".webm": ("libvpx-vp9", "yuv420p"),
}


def write_video(path, num_frames=40, frame=numbered_frame):
    frames = (frame(index % 40) for index in range(num_frames))
    return write_film(path, frames, *CODECS[path.suffix])


def noisy_frame(index):
    noise = np.random.default_rng(index).integers(0, 40, (48, 64, 3))
    return (numbered_frame(index) // 2 + noise).astype(np.uint8)


def cut(path, fraction):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * fraction)])
    return path


def test_a_video_gives_its_frames_from_any_one_on(tmp_path):
    source = open_frames(write_video(tmp_path / "walk.mp4"))
    assert (source.name, source.width, source.height, source.fps) == ("walk", 64, 48, 25.0)
    assert (source.frames_expected, source.num_frames) == (40, None)
    assert [number_of(frame) for frame in source] == list(range(40))
    assert (source.num_frames, source.truncated, source.note) == (40, False, None)
    assert [number_of(frame) for frame in source.frames(start=37)] == [37, 38, 39]


def test_start_frames_outside_the_video_are_refused(tmp_path):
    source = open_frames(write_video(tmp_path / "walk.mp4", 5))
    for start in (5, 99, 10**20):
        message = message_of(lambda start=start: next(source.frames(start)))
        assert f"frame {start}" in message
        assert "has 5 frame(s)" in message
        assert "from 0 to 4" in message


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


def test_frames_are_shown_at_their_timestamps(tmp_path):
    seconds = [0.0, 0.1, 0.5, 0.6]
    frames, stamps = [numbered_frame(number) for number in range(4)], [0, 100, 500, 600]
    path = write_film(tmp_path / "varying.mkv", frames, stamps=stamps)
    source, given = open_frames(path), open_frames(path, fps=5)
    shown = [source.shown_at(number) for number, _ in enumerate(source)]
    np.testing.assert_allclose(shown, seconds)
    given_times = [given.shown_at(number) for number, _ in enumerate(given)]
    np.testing.assert_allclose(given_times, [0, 0.2, 0.4, 0.6])
    assert "fps=0 must be a finite number above 0" in message_of(lambda: open_frames(path, fps=0))


# The linear part of a display matrix by rows, and what it does to a picture.
ORIENTATIONS = {
    (1, 0, 0, 1): lambda picture: picture,
    (-1, 0, 0, 1): lambda picture: picture[:, ::-1],
    (1, 0, 0, -1): lambda picture: picture[::-1],
    (-1, 0, 0, -1): lambda picture: picture[::-1, ::-1],
    (0, 1, 1, 0): lambda picture: picture.transpose(1, 0, 2),
    (0, 1, -1, 0): lambda picture: np.rot90(picture, -1),
    (0, -1, 1, 0): lambda picture: np.rot90(picture),
    (0, -1, -1, 0): lambda picture: np.rot90(picture, 2).transpose(1, 0, 2),
}


@pytest.mark.parametrize("matrix", ORIENTATIONS)
def test_frames_are_turned_and_mirrored_as_the_film_says(tmp_path, matrix):
    a, b, c, d = (part << 16 for part in matrix)

    def turn(stream):
        stream.set_display_matrix([a, b, 0, c, d, 0, 0, 0, 1 << 30])
        stream.codec_context.sample_aspect_ratio = Fraction(4, 3)

    frames = [moving_square(number) for number in range(3)]
    plain = list(open_frames(write_film(tmp_path / "plain.mp4", frames)))
    source = open_frames(write_film(tmp_path / "turned.mp4", frames, prepare=turn))
    for frame, stored in zip(source, plain, strict=True):
        np.testing.assert_array_equal(frame, ORIENTATIONS[matrix](stored))
        assert frame.shape == (source.height, source.width, 3)
    assert source.pixel_aspect == (Fraction(4, 3) if matrix[0] else Fraction(3, 4))
    assert "coordinates count pixels" in source.note


def test_a_film_without_some_of_its_frames_or_with_other_sound_is_whole(tmp_path):
    """A long pause, an edit list that drops frames, and sound that goes on after the film."""
    frames = [numbered_frame(number) for number in range(10)]
    stamps = [40 * number + 60_000 * (number > 4) for number in range(10)]
    pause = write_film(tmp_path / "pause.mkv", frames, stamps=stamps, rate=1000)
    whole = write_film(tmp_path / "whole.mp4", frames, options={"g": "5", "bf": "0"})
    edited, loud = tmp_path / "edited.mp4", tmp_path / "loud.mkv"
    data = whole.read_bytes()
    place = data.index(b"elst") + 4
    first = struct.pack(">IIIi", 0, 1, 240, 4 * 512)  # from the fifth frame on
    assert data[place : place + 8] == bytes([0, 0, 0, 0, 0, 0, 0, 1])
    edited.write_bytes(data[:place] + first + data[place + len(first) :])
    with av.open(str(whole)) as source, av.open(str(loud), "w") as file:
        film = file.add_stream_from_template(source.streams.video[0])
        sound: av.AudioStream = file.add_stream("pcm_s16le", rate=8000)
        silence = av.AudioFrame.from_ndarray(np.zeros((1, 16000), np.int16), "s16", "mono")
        silence.sample_rate = 8000
        file.mux(sound.encode(silence))
        for packet in source.demux(video=0):
            if packet.size:
                packet.stream = film
                file.mux(packet)
    for path, count in ((pause, 10), (edited, 6), (loud, 10)):
        source = open_frames(path)
        assert len(list(source)) == count
        assert (source.truncated, source.note) == (False, None)


def test_a_size_that_changes_on_the_way_is_refused_where_it_does(tmp_path):
    both = tmp_path / "both.ts"
    with both.open("wb") as file:
        for width, height in ((64, 48), (96, 64)):
            frames = [np.full((height, width, 3), 10 * number, np.uint8) for number in range(20)]
            file.write(write_film(tmp_path / f"{width}.ts", frames).read_bytes())
    frames = open_frames(both).frames()
    assert [next(frames).shape for _ in range(20)] == 20 * [(48, 64, 3)]
    message = message_of(next, frames)
    assert f"'{both}' changes its size at frame 20, from 64x48 to 96x64; convert it" in message


def test_what_cannot_be_decoded_is_refused_with_its_cause(tmp_path):
    path = tmp_path / "walk.mp4"
    with VideoWriter(path, 64, 48, 25) as video:
        video.write(numbered_frame(0))
    data = path.read_bytes()
    path.write_bytes(data.replace(b"avc1", b"none").replace(b"avcC", b"nonC"))
    assert "cannot be decoded (its codec is unknown)" in message_of(open_frames, path)
    cut(write_video(path, frame=noisy_frame), 0.6)  # without its index
    assert f"'{path}' cannot be decoded (invalid data" in message_of(open_frames, path)


def test_memory_does_not_grow_with_the_length(tmp_path):
    def peak(num_frames):
        source = open_frames(write_video(tmp_path / "long.avi", num_frames))
        tracemalloc.start()
        for frame in source:
            _copy = frame.copy()  # memory of PyAV's own, from 19 on, is not traced
        result = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return result

    peak(2)  # imports what reading needs
    one_frame = 64 * 48 * 3
    assert one_frame < peak(50) < peak(10) + 2 * one_frame


def test_nothing_is_printed_and_standard_error_is_put_back(tmp_path):
    write_video(tmp_path / "good.webm", 3)
    cut(write_video(tmp_path / "bad.mp4", frame=noisy_frame), 0.5)
    damaged = write_film(tmp_path / "damaged.avi", [noisy_frame(0)] * 4)
    damaged.write_bytes(damaged.read_bytes().replace(b"\x00\x00\x01", b"\x17\x00\x01"))
    (tmp_path / "pictures").mkdir()
    cv2.imwrite(str(tmp_path / "pictures" / "0.png"), noisy_frame(0))
    cut(tmp_path / "pictures" / "0.png", 0.5)
    program = (
        "import os, sys, numpy as np; from jaxpf.media import VideoWriter, open_frames\n"
        "for name in ('good.webm', 'damaged.avi', 'bad.mp4', 'pictures', '63'):\n"
        "    try: list(open_frames(name))\n"
        "    except ValueError: pass\n"
        "with VideoWriter('out.mp4', 64, 48, 25) as w: w.write(np.zeros((48, 64, 3), np.uint8))\n"
        "assert 'jax' not in sys.modules\n"
        "os.write(2, b'said')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=500
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "said")


def test_a_colon_in_a_relative_name_is_no_protocol(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_video(Path("part:one.webm"), 4)
    assert len(list(open_frames("part:one.webm"))) == 4
