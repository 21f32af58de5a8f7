"""Clips that are longer than memory: read in chunks, to the same bits."""

import subprocess
import sys

import numpy as np
import pytest
from clips import write_table
from films import write_film
from small_evaluation import RUNS, TWICE, assert_equal_bits, content, names, small_plan
from small_sequence_folder import write_sequence

from jaxpf import InputError
from jaxpf.evaluation import evaluate
from jaxpf.evaluation.scene import load_scene
from jaxpf.running import chunks
from jaxpf.sequences import sequence as sequences
from jaxpf.sequences.frames import Frames


@pytest.fixture
def folder(tmp_path):
    return write_sequence(tmp_path / "two")


def plan(folder, **given):
    return small_plan(lambda: load_scene(str(folder)), **given)


@pytest.mark.slow
def test_a_clip_in_chunks_gives_the_same_bits_also_after_an_interruption(
    folder, tmp_path, monkeypatch
):
    whole = evaluate(plan(folder, runs=TWICE), tmp_path / "whole", runs_per_batch=RUNS)
    monkeypatch.setattr(sequences, "MOST_KEPT", 0)
    monkeypatch.setattr(chunks, "CHUNK_BYTES", 1)  # two frames
    pictures = Frames.__iter__

    # The power fails while the second batch is half-way through the clip: 10 frames of the
    # digest, 9 of the first batch.
    budget = iter(range(1 + 10 + 9 + 5))

    def until_then(frames):
        for picture in pictures(frames):
            if next(budget, None) is None:
                raise KeyboardInterrupt
            yield picture

    monkeypatch.setattr(Frames, "__iter__", until_then)
    with pytest.raises(KeyboardInterrupt):
        evaluate(plan(folder, runs=TWICE), tmp_path / "part", runs_per_batch=RUNS)
    assert len(names(tmp_path / "part")) == 1
    monkeypatch.setattr(Frames, "__iter__", pictures)
    continued = evaluate(plan(folder, runs=TWICE), tmp_path / "part", runs_per_batch=RUNS)
    assert_equal_bits(content(continued), content(whole))


def test_a_damaged_picture_is_told_in_one_sentence(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(sequences, "MOST_KEPT", 0)
    (folder / "0007.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"0007\.png' cannot be decoded"):
        evaluate(plan(folder), tmp_path / "out")


#: Evaluates 36 frames, allows itself so many more bytes than it has by then, and evaluates all.
UNDER_A_LIMIT = """
import functools, pathlib, resource, sys
from jaxpf.cli.shared.startup import use_compile_cache
use_compile_cache()
import numpy as np
from jaxpf.evaluation import (Plan, evaluate)
from jaxpf.evaluation.scene import load_scene
from jaxpf.running import chunks

chunks.CHUNK_BYTES = 16 * 2**20

def evaluated(name, num_frames):
    load = functools.partial(load_scene, source=sys.argv[1], num_frames=num_frames)
    plan = Plan(load, methods=["sir"], runs=1, grid={"num_particles": (20,)})
    return evaluate(plan, pathlib.Path(sys.argv[1]) / name)

evaluated("short", 37)
status = pathlib.Path("/proc/self/status").read_text()
now = int(status.partition("VmData:")[2].split()[0]) * 1024
resource.setrlimit(resource.RLIMIT_DATA, (now + int(sys.argv[2]), -1))
frames = load_scene(sys.argv[1]).frames
try:
    np.empty(frames.shape, np.uint8)
    sys.exit("all frames fit")
except MemoryError:
    pass
results = evaluated("long", None)
(batch,) = results.batches(results.configurations[0])
print(batch.shapes.shape[1])
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits and /proc are Linux's")
def test_a_clip_that_does_not_fit_into_memory_is_evaluated(tmp_path):
    length, allowed = 18 * 61 + 1, 320 * 2**20
    picture = np.zeros((480, 640, 3), np.uint8)

    def shown(number):
        frame = picture.copy()
        frame[200:240, number % 600 :][:, :40] = (220, 90, 40)
        return frame

    write_film(tmp_path / "clip.mp4", map(shown, range(length)), "mpeg4")
    rows = ((number, 1, number % 600, 200, 40, 40, 0) for number in range(length))
    write_table(tmp_path / "gt.csv", "frame,id,x,y,w,h,occ", *rows)
    (tmp_path / "meta.json").write_text(
        f'{{"name": "long", "frames": "clip.mp4", "n_frames": {length}, "width": 640, '
        '"height": 480, "fps": 25}'
    )
    assert length * picture.nbytes > max(3 * allowed, sequences.MOST_KEPT)
    done = subprocess.run(
        [sys.executable, "-c", UNDER_A_LIMIT, str(tmp_path), str(allowed)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == length - 1
