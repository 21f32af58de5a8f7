"""Cameras, streams and pipes."""

import contextlib
import os
import signal
import socket
import threading

import numpy as np
import pytest
from live_sources import put_camera, served
from small_video import LENGTH, picture, write_lossless_video

from jaxpf import InputError
from jaxpf.media import open_frames


@pytest.fixture
def clip(tmp_path):
    return write_lossless_video(tmp_path / "clip.avi", map(picture, range(LENGTH)))


def message_of(address):
    with pytest.raises(InputError) as caught:
        open_frames(address)
    return str(caught.value)


def test_a_stream_and_a_pipe_give_every_frame_once_and_in_order(clip, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    threading.Thread(target=lambda: pipe.write_bytes(clip.read_bytes()), daemon=True).start()
    with served(tmp_path) as server:
        for source in (open_frames(f"{server}/clip.avi"), open_frames(pipe)):
            assert (source.width, source.height, source.fps) == (64, 48, 25)
            assert source.is_live
            assert not source.is_camera
            expected = list(open_frames(clip).frames(2))
            np.testing.assert_array_equal(list(source.frames(2)), expected)
            assert (source.num_frames, source.note) == (LENGTH, None)
            with pytest.raises(InputError, match="can be read only once; open it again"):
                next(source.frames())


@pytest.mark.parametrize("garbage", [bytes(range(256)) * 500, b"no video\n" * 1000])
def test_a_pipe_that_carries_no_video_is_refused_at_once(tmp_path, garbage):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def write():
        with contextlib.suppress(BrokenPipeError):
            pipe.write_bytes(garbage)

    threading.Thread(target=write, daemon=True).start()
    assert "check what is written into it" in message_of(pipe)


def test_a_stream_that_breaks_off_says_so(clip, tmp_path):
    data = clip.read_bytes()
    (tmp_path / "cut.avi").write_bytes(data[: len(data) // 2])
    with served(tmp_path) as server:
        source = open_frames(f"{server}/cut.avi")
        count = len(list(source))
    assert 0 < count < LENGTH
    assert source.truncated
    assert f"announces {LENGTH} frames, and {count} can be decoded: it is cut off" in source.note


@pytest.mark.slow
def test_a_stream_that_falls_silent_ends_and_says_so(clip):
    answer = b"HTTP/1.1 200 OK\r\nContent-Type: video/x-msvideo\r\n\r\n"
    with socket.create_server(("127.0.0.1", 0)) as server, contextlib.ExitStack() as held:

        def answer_all():
            with contextlib.suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    held.enter_context(connection)
                    connection.recv(4096)
                    connection.sendall(answer + clip.read_bytes()[:-2000])

        threading.Thread(target=answer_all, daemon=True).start()
        source = open_frames(f"http://127.0.0.1:{server.getsockname()[1]}/clip.avi")
        frames = list(source)
    assert frames
    assert f"sent nothing for 10 s after frame {len(frames) - 1}" in source.note


def test_a_camera_gives_its_latest_frame_and_counts_those_left_out(monkeypatch):
    taken, many = threading.Event(), threading.Event()

    def before_read(number):
        if number:
            taken.wait()
        if number == 10:
            many.set()

    put_camera(
        monkeypatch,
        lambda number: np.full((4, 6, 3), number, np.uint8) if number < 50 else None,
        pause=0.01,
        before_read=before_read,
    )
    source = open_frames("0")
    taken.set()  # not before: a camera's frames do not wait
    assert (source.name, source.path, source.fps) == ("camera-0", "0", 30)
    frames = source.frames()
    assert next(frames)[0, 0, 0] == 0
    many.wait()
    later = [int(frame[0, 0, 0]) for frame in frames]
    assert later[0] > 3
    assert later == sorted(set(later))
    assert later[-1] == 49
    assert source.num_left_out == 50 - 1 - len(later)
    assert f"{source.num_left_out} frames of camera '0' came while others were" in source.note


def test_what_does_not_open_or_gives_nothing_is_one_sentence(tmp_path, monkeypatch):
    assert "camera '63' does not open; check that it is plugged in" in message_of("63")
    (tmp_path / "noise.mp4").write_bytes(bytes(range(256)) * 20)
    with served(tmp_path) as server:
        for name in ("gone.mp4", "noise.mp4"):
            assert f"stream '{server}/{name}' does not open" in message_of(f"{server}/{name}")
    message = message_of("rtsp://me:secret@127.0.0.1:1/door")
    assert "stream 'rtsp://me:***@127.0.0.1:1/door' does not open" in message
    assert "is not an address of a stream" in message_of("http://[::1/door")
    put_camera(monkeypatch, lambda number: None)
    assert "camera '0' opens but gives no picture" in message_of(0)


def test_a_size_that_changes_is_refused_naming_both(monkeypatch):
    taken = threading.Event()
    put_camera(
        monkeypatch,
        lambda number: np.zeros((4, 6 + 2 * (number > 0), 3), np.uint8),
        before_read=lambda number: number and taken.wait(),
    )
    source = open_frames(0)
    taken.set()
    with pytest.raises(InputError, match="at frame 1, from 6x4 to 8x4; convert it to one size"):
        list(source)


def test_a_file_named_by_a_number_is_no_camera(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_lossless_video(tmp_path / "7.avi", [picture(0)]).rename("7")
    assert not open_frames("7").is_live


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_is_answered_while_a_source_is_silent(monkeypatch):
    silent, spoke = threading.Event(), threading.Event()

    def before_read(number):
        if number:
            silent.wait(120)
            spoke.set()

    put_camera(monkeypatch, picture, before_read=before_read)
    frames = open_frames(0).frames()
    next(frames)

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    try:
        with pytest.raises(KeyboardInterrupt):
            next(frames)
        assert not spoke.is_set()
    finally:
        signal.signal(signal.SIGALRM, before)
        silent.set()
