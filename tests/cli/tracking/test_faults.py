"""``jaxpf track``: what is reported rather than silent, and interruptions."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from clips import write_pictures
from small_video import BOXES, LENGTH, picture, rows_of, summary_of

from jaxpf import InputError
from jaxpf.boxes import read_tracks
from jaxpf.media import open_frames


def test_a_lost_object_is_reported_marked_and_listed(run_of):
    outcome, output = run_of("lost")
    assert "Lost: object 1 was outside the picture in 3 frames, first in frame 1." in outcome.err
    assert summary_of(output)["frames_outside"]["1"] == [1, 2, 3]
    np.testing.assert_array_equal(rows_of(output)[:, 6], [1, 1, 0, 0, 0, 0, 0, 0])


def test_colour_cannot_tell_who_is_lost_and_nobody_invents_a_number(run_of):
    _, output = run_of("lost")
    assert "confidence" not in (output / "diagnostics.csv").read_text()
    assert "confidence" not in read_tracks(output / "tracks.csv")
    assert summary_of(output)["objects"]["1"]["mean_confidence"] is None


def test_a_frame_that_no_particle_explains_is_left_out_and_counted(run_of):
    outcome, output = run_of("impossible")
    assert "Warning: 2 frames had likelihood zero for all particles" in outcome.err
    summary = summary_of(output)
    assert summary["impossible_frames"] == 2
    assert summary["frames_without_likelihood"] == {"1": [1, 2], "2": [1, 2]}
    assert cv2.imread(str(output / "trajectories.png")) is not None


def test_likelihoods_that_are_no_number_are_counted(run_of):
    outcome, output = run_of("no number")
    assert "likelihood(s) were not a number and counted as zero" in outcome.err
    assert summary_of(output)["invalid_likelihoods"] > 0


def test_a_truncated_video_is_tracked_as_far_as_it_goes_with_a_note(run_of):
    outcome, output = run_of("cut")
    assert re.search(r"Note: .*announces 10 frames.*it is cut off or damaged", outcome.err)
    summary = summary_of(output)
    assert summary["video_truncated"] is True
    assert 0 < summary["frames_tracked"] < LENGTH - 1


def test_a_fault_of_the_video_on_the_way_keeps_what_was_tracked(track, tmp_path):
    frames = [picture(0), picture(1), picture(2)[:40]]
    outcome = track(*BOXES, video=write_pictures(tmp_path / "mixed", frames))
    assert outcome.code == 2
    assert "changes its size at '2.png', from 64x48 to 64x40" in outcome.err
    assert rows_of(tmp_path / "out").shape == (4, 7)
    assert len(list(open_frames(tmp_path / "out" / "overlay.mp4"))) == 2
    assert "changes its size" in summary_of(tmp_path / "out")["error"]


def test_a_disk_that_fills_up_is_one_sentence_and_keeps_whole_lines(track, tmp_path, monkeypatch):
    class Filling:
        """Room for three lines and three bytes."""

        def __init__(self, *arguments, **settings):
            self.file, self.lines = open(*arguments, **settings), 0  # noqa: SIM115
            self.truncate, self.seek = self.file.truncate, self.file.seek
            self.close = self.file.close

        def write(self, data):
            self.lines += 1
            if self.lines <= 3:
                return self.file.write(data)
            self.file.write(data[:3])
            raise OSError(28, "No space left on device")

    def opened(path, *arguments, **settings):
        kind = Filling if Path(path).name == "diagnostics.csv" else open
        return kind(path, *arguments, **settings)

    monkeypatch.setattr("jaxpf.files.writing.open", opened, raising=False)
    outcome = track(*BOXES)
    assert outcome.code == 2
    assert re.search(r"cannot write '.*diagnostics.csv': no space left", outcome.err)
    assert (tmp_path / "out" / "diagnostics.csv").read_text().count("\n") == 3
    assert summary_of(tmp_path / "out")["frames_tracked"] == 2


@pytest.fixture
def old(tmp_path):
    """What an earlier run left in the output folder: name -> content."""
    (tmp_path / "out").mkdir()
    content = {name: f"old {name}" for name in ("tracks.csv", "run.toml", "overlay.mp4")}
    for name, text in content.items():
        (tmp_path / "out" / name).write_text(text)
    return content


def left_in(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_an_overlay_that_cannot_be_opened_loses_no_old_results(track, tmp_path, monkeypatch, old):
    def refuse(*_):
        raise InputError("the encoder refuses")

    monkeypatch.setattr("jaxpf.media.video_writer.VideoWriter._check_encoder", refuse)
    outcome = track(*BOXES, "--overwrite")
    assert (outcome.code, "the encoder refuses" in outcome.err) == (2, True)
    assert left_in(tmp_path / "out") == old


def test_ctrl_c_before_the_first_frame_leaves_what_was_there(track, tmp_path, monkeypatch, old):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("jaxpf.detections.following.stream", interrupted)
    assert track(*BOXES, "--overwrite").code == 130
    assert left_in(tmp_path / "out") == old
    assert track(*BOXES, "-o", tmp_path / "new").code == 130
    assert not (tmp_path / "new").exists()
