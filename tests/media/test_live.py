"""Cameras and streams."""

import numpy as np
import pytest
from live_sources import put_camera, served
from refusals import message_of
from small_video import LENGTH, picture, write_lossless_video

from jaxpf.media import open_frames


@pytest.fixture
def clip(tmp_path):
    return write_lossless_video(tmp_path / "clip.avi", map(picture, range(LENGTH)))


def test_a_stream_gives_every_frame_in_order(clip, tmp_path):
    with served(tmp_path) as server:
        source = open_frames(f"{server}/clip.avi")
        assert (source.width, source.height, source.fps) == (64, 48, 25)
        assert (source.name, source.is_live) == ("clip", True)
        np.testing.assert_array_equal(list(source.frames(2)), list(open_frames(clip).frames(2)))
        assert source.num_frames == LENGTH


def test_a_camera_gives_its_frames_with_the_times_at_which_they_come(monkeypatch):
    put_camera(
        monkeypatch,
        lambda number: np.full((4, 6, 3), number, np.uint8) if number < 9 else None,
        pause=0.01,
    )
    source = open_frames("0")
    assert (source.name, source.path, source.fps) == ("camera-0", "0", 30)
    assert [frame[0, 0, 0] for frame in source] == list(range(9))
    steps = np.diff([source.shown_at(number) for number in range(9)])
    assert np.all(steps >= 0.01)


def test_what_does_not_open_or_gives_nothing_is_one_sentence(tmp_path, monkeypatch):
    assert "camera '63' does not open; check that it is plugged in" in message_of(open_frames, 63)
    (tmp_path / "noise.mp4").write_bytes(bytes(range(256)) * 20)
    with served(tmp_path) as server:
        for name in ("gone.mp4", "noise.mp4"):
            message = message_of(open_frames, f"{server}/{name}")
            assert f"stream '{server}/{name}' does not open" in message
    message = message_of(open_frames, "rtsp://me:secret@127.0.0.1:1/door")
    assert "stream 'rtsp://me:***@127.0.0.1:1/door' does not open" in message
    assert "is not an address of a stream" in message_of(open_frames, "http://[::1/door")
    put_camera(monkeypatch, lambda number: None)
    assert "camera '0' gives no picture" in message_of(open_frames, 0)


def test_a_size_that_changes_is_refused_naming_both(monkeypatch):
    put_camera(monkeypatch, lambda number: np.zeros((4, 6 + 2 * (number > 0), 3), np.uint8))
    message = message_of(list, open_frames(0))
    assert "at frame 1, from 6x4 to 8x4; convert it to one size" in message


def test_a_file_named_by_a_number_is_no_camera(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_lossless_video(tmp_path / "7.avi", [picture(0)]).rename("7")
    assert not open_frames("7").is_live
