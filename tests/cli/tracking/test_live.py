"""``jaxpf track`` on streams and cameras."""

import _thread
import contextlib
import signal

import numpy as np
import pytest
from live_sources import put_camera, served
from small_video import BOXES, picture, rows_of, summary_of, true_boxes

from jaxpf.media import open_frames


@pytest.mark.slow
@pytest.mark.always
def test_a_stream_is_tracked_as_its_file_is(track, place, whole_run, tmp_path):
    with served(place) as server:
        outcome = track(*BOXES, video=f"{server}/clip.avi")
        assert outcome.code == 0, outcome.err
        again = track(
            "--config", tmp_path / "out/run.toml", "-o", "again", video=f"{server}/no.avi"
        )
    assert "no.avi' does not open" in again.err
    np.testing.assert_array_equal(rows_of(tmp_path / "out"), rows_of(whole_run[1]))


def test_a_camera_is_tracked_until_ctrl_c_which_keeps_all_results(track, tmp_path, monkeypatch):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def seen(number):
        with contextlib.suppress(FileNotFoundError):
            written = (tmp_path / "out" / "tracks.csv").read_text().count("\n")
            if written > 43:  # a frame that is being written is taken back
                _thread.interrupt_main()
        # Minutes later: a Ctrl-C that is not answered fails the test.
        return picture(0) if number < 100_000 else None

    put_camera(monkeypatch, seen, 0.002)
    outcome = track(*BOXES, video="0")
    signal.signal(signal.SIGINT, before)
    assert outcome.code == 130, outcome.err
    summary = summary_of(tmp_path / "out")
    assert summary["interrupted"] is True
    assert summary["parameters"]["video"] == "0"
    rows = rows_of(tmp_path / "out")
    assert len(rows) > 40
    assert abs(len(rows) / 2 - 1 - summary["frames_tracked"]) <= 1
    assert np.abs(rows[:, 2:4].reshape(-1, 2, 2) - true_boxes(0)[:, :2] - 1).max() < 4
    monkeypatch.undo()  # a camera no longer
    shown = len(list(open_frames(tmp_path / "out" / "overlay.mp4")))
    assert abs(shown - 1 - summary["frames_tracked"]) <= 1
