"""``jaxpf track``: two at once, the request to end, and a disk that fills."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from small_video import BOXES, LENGTH, PARTICLES, picture, summary_of, write_lossless_video

from jaxpf.boxes import read_boxes
from jaxpf.files.store import LOCK, locked
from jaxpf.media import open_frames

#: A program that is started in the background inherits an ignored Ctrl-C.
PROGRAM = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from jaxpf.cli import main
main()
"""
posix = pytest.mark.skipif(os.name == "nt", reason="signals, locks and limits of POSIX")


@posix
def test_two_runs_do_not_write_into_one_folder(track, tmp_path):
    with locked(tmp_path / "out", "tracking"):
        outcome = track(*BOXES, "--overwrite")
    assert outcome.code == 2
    assert "another process is tracking into" in outcome.err
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [LOCK]


@pytest.mark.slow
@posix
@pytest.mark.parametrize(
    ("name", "code", "said"),
    [
        pytest.param("SIGTERM", 143, "Terminated.", marks=pytest.mark.always),
        ("SIGHUP", 143, "Terminated."),
        ("SIGINT", 130, "Interrupted."),
    ],
)
def test_a_request_to_end_leaves_what_was_tracked_and_is_answered_at_once(
    tmp_path, name, code, said
):
    if name == "SIGHUP" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        pytest.skip("started under nohup, which programs started from here inherit")
    frames = (picture(number % LENGTH, noise=False) for number in range(1000))
    clip = write_lossless_video(tmp_path / "long.avi", frames)
    output = tmp_path / "out"
    given = (*BOXES, *PARTICLES, "--appearance", "colour", "-o", output)  # compiled soonest
    command = [sys.executable, "-c", PROGRAM, "track", clip, *given]
    process = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, text=True)
    try:
        deadline = time.monotonic() + 600
        while process.poll() is None and time.monotonic() < deadline:
            with contextlib.suppress(FileNotFoundError):
                if (output / "tracks.csv").read_text().count("\n") > 20:
                    break
            time.sleep(0.02)
        process.send_signal(getattr(signal, name))
        ended, errors = process.wait(600), process.stderr.read()
    finally:
        process.kill()
        process.stderr.close()
    assert ended == code
    assert ("Finishing: what was tracked is being written." in errors) or name == "SIGINT"
    assert errors.strip().endswith(said)
    assert "Traceback" not in errors
    summary = summary_of(output)
    assert summary["interrupted"] is True
    assert 3 < summary["frames_tracked"] < 999
    shown = len(list(open_frames(output / "overlay.mp4")))
    assert abs(len(read_boxes(output / "tracks.csv")) / 2 - 1 - summary["frames_tracked"]) <= 1
    assert abs(shown - 1 - summary["frames_tracked"]) <= 1
    assert (output / "trajectories.png").exists()
    assert not (output / LOCK).exists()


@posix
@pytest.mark.slow
def test_a_disk_that_fills_leaves_no_cut_overlay_under_its_final_name(place, tmp_path):
    # What a full disk does, a limit of the size of files does too.  The program sets its own:
    # `preexec_fn` may hang in a process with threads.
    small = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)); "
    noise = np.random.default_rng(0).integers(0, 256, (60, 48, 64, 3), dtype=np.uint8)
    clip = write_lossless_video(tmp_path / "noise.avi", noise)
    output = tmp_path / "out"
    command = [sys.executable, "-c", small + PROGRAM, "track", clip, *BOXES, *PARTICLES]
    command = [*map(str, command), "-o", str(output)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "check the free disk space" in done.stderr
    assert not list(output.glob("*overlay*"))
    assert "check the free disk space" in summary_of(output)["error"]
