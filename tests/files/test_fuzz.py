"""Thousands of damaged files, the same every time, through every reader.

A reader reads a file or refuses it in one short sentence: no traceback, no warning, no hang.
"""

import contextlib
import functools
import json
import random
import signal
import warnings
from types import SimpleNamespace

import click
import numpy as np
import pytest
from clips import write_pictures
from small_tuning import QUICK, SCALE, made_sequence
from small_video import picture, write_lossless_video

import jaxpf
from jaxpf import InputError
from jaxpf.boxes import read_boxes
from jaxpf.boxes.target import start_boxes
from jaxpf.cli.shared.flags import NumberList, config_flag
from jaxpf.contours.files import read_contours
from jaxpf.detections.files import read_detections
from jaxpf.evaluation import Results
from jaxpf.files.store import Store
from jaxpf.media import open_frames
from jaxpf.parts.files import read_parts
from jaxpf.points.files import read_points
from jaxpf.sequences import open_sequence
from jaxpf.sequences.tables import dense
from jaxpf.tuning import checkpoint

SEED = 17
#: Seconds that a reader may take for a file of some hundred bytes.
SECONDS = 10
#: What people, programs and disks put into files that should not hold it.
TOKENS = (
    *(b"\0", b"\xff", b"\xe9", b"\xef\xbb\xbf", b"\r", b"\n", b"\n\n"),
    *(b"\t", b'"', b"'", b",", b";"),
    *(b"nan", b"inf", b"-1", b"0", b"1e999", b"1e300", b"-0.0", b"9" * 30, b"9" * 400, b"1_0"),
    *(b"[", b"]", b"{", b"}", b"[" * 2000, b"null", b"true", b"%", b"%s", b"\\", b"\xd9\xa3"),
    *(b"=", b"#", b" ", b"x" * 3000, b"-", b".", b"e", b"+", b"1.5", b"[/red]"),
)

BOXES = b"frame,id,x,y,w,h,occ\n0,2,1,2,3,4,0\n0,7,4,1,2,2,1\n1,2,1.5,2,3,4,-1\n2,2,2,2,3,4,2\n"
MOT = b"1,2,2,3,3,4,1,-1,-1,-1\n1,7,5,2,2,2,1,-1,-1,-1\n2,2,2.5,3,3,4,0.5,-1,-1,-1\n"
PARTS = b"part,parent,x,y,w,h,angle\nbody,,20,17,34,30,12\narm,body,23,18,28,16,20\n"
POINTS = b"x,y,name\n12,16,nose\n46,30,tail\n1.5,2e1,ear\n"
CONTOURS = b'{"closed": true, "contours": {"leaf": [[10, 20], [30, 18], [32, 40], [12, 38]]}}'
DETECTIONS = b"1,-1,2,3,3,4,.9,-1,-1,-1\n1,-1,5,2,2,2,.8,-1,-1,-1\n2,-1,2.5,3,3,4,0.5,-1,-1,-1\n"
META = b'{"name": "a", "frames": "%d.png", "n_frames": 3, "width": 8, "height": 6, "fps": 10}'
SEQINFO = b"[Sequence]\nname=a\nimDir=img1\nframeRate=30\nseqLength=3\nimWidth=8\nimHeight=6\n"
OTB = b"2,3,3,4\n0,0,0,0\n3,3,3,4\n"
TOML = (
    b'[a]\nruns = 3\nname = "x"\nscale = [1, 2.5]\nbox = ["1,2,3,4", [1, 2, 3, 4]]\nflag = true\n'
)


#: The pictures of a clip.
BLACK = np.zeros((3, 6, 8, 3), np.uint8)


def mutated(data, rng):
    """A valid file with one to four faults."""
    data = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        at = rng.randint(0, len(data))
        until = min(len(data), at + rng.choice((1, 1, 2, 8, 40)))
        fault = rng.randint(0, 5)
        if fault == 0:
            data[at:until] = b""
        elif fault == 1:
            data[at:at] = rng.choice(TOKENS)
        elif fault == 2:
            data[at:until] = rng.choice(TOKENS)
        elif fault == 3 and at < len(data):
            data[at] = rng.randint(0, 255)
        elif fault == 4:
            data[at:at] = data[at:until]
        elif rng.random() < 0.2:
            del data[at:]
    return bytes(data)


@contextlib.contextmanager
def limited(seconds):
    def late(*_):
        raise AssertionError(f"took more than {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def survives(path, valid, read, count, name):
    """Read so many damaged copies of a file; returns how many were refused."""
    rng = random.Random(f"{SEED} {name}")
    path.write_bytes(valid)
    read(path)
    refusals = 0
    for number in range(count):
        data = mutated(valid, rng)
        path.write_bytes(data)
        try:
            with warnings.catch_warnings(), limited(SECONDS):
                warnings.simplefilter("error")
                read(path)
        except (InputError, click.ClickException) as refusal:
            refusals += 1
            sentence = getattr(refusal, "message", None) or str(refusal)
            assert "\n" not in sentence, (number, data)
            assert len(sentence) < 1200, (number, data)
        except BaseException as error:
            raise AssertionError(f"{name}, case {number}: {error!r} of {data[:400]!r}") from error
    path.write_bytes(valid)
    return refusals


def read_table(path):
    table = read_boxes(path)
    if len(table):
        dense(table, [int(table.id[0])], 5)
        start_boxes(table, int(table.frame[0]), SimpleNamespace(width=64, height=48))


def read_scene(folder, path):
    scene = open_sequence(folder).scene()
    assert scene.frames.shape[0] >= 1


@click.command("a", params=[config_flag()])
@click.option("--runs", default=1)
@click.option("--name", default="")
@click.option("--scale", type=NumberList(float, 2))
@click.option("--box", multiple=True)
@click.option("--flag", is_flag=True)
def command(**options):
    pass


def read_configuration(path):
    command.main(["--config", str(path)], standalone_mode=False)


needs_alarms = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="alarms of POSIX")
pytestmark = [pytest.mark.slow, needs_alarms]


@pytest.mark.parametrize(
    ("valid", "read", "count"),
    [
        pytest.param(BOXES, read_table, 800, id="boxes"),
        pytest.param(MOT, read_table, 600, id="mot"),
        pytest.param(PARTS, read_parts, 700, id="parts"),
        pytest.param(TOML, read_configuration, 700, id="toml"),
        pytest.param(POINTS, read_points, 400, id="points"),
        pytest.param(CONTOURS, read_contours, 400, id="contours"),
        pytest.param(DETECTIONS, read_detections, 400, id="detections"),
    ],
)
def test_damaged_texts_are_read_or_refused(tmp_path, valid, read, count, request):
    refusals = survives(tmp_path / "file", valid, read, count, request.node.name)
    assert count / 4 < refusals < count


def test_damaged_clips_are_read_or_refused(tmp_path):
    write_pictures(tmp_path, BLACK)
    read = functools.partial(read_scene, tmp_path)
    (tmp_path / "gt.csv").write_bytes(BOXES)
    assert survives(tmp_path / "meta.json", META, read, 400, "meta") > 100
    assert survives(tmp_path / "gt.csv", BOXES, read, 400, "gt") > 100


def test_damaged_sequences_of_benchmarks_are_read_or_refused(tmp_path):
    mot, otb = tmp_path / "mot", tmp_path / "otb"
    for folder in (mot / "img1", otb / "img"):
        write_pictures(folder, BLACK, first=1)
    (mot / "gt").mkdir()
    (mot / "gt" / "gt.txt").write_bytes(MOT)
    read = functools.partial(read_scene, mot)
    assert survives(mot / "seqinfo.ini", SEQINFO, read, 300, "seqinfo") > 50
    assert survives(mot / "gt" / "gt.txt", MOT, read, 300, "gt.txt") > 50
    read = functools.partial(read_scene, otb)
    assert survives(otb / "groundtruth_rect.txt", OTB, read, 200, "otb") > 50


def test_damaged_checkpoints_and_settings_are_read_or_refused(tmp_path):
    store = Store(tmp_path / "tuned")
    result = jaxpf.tune(made_sequence(), SCALE, settings=QUICK, folder=store.folder)
    valid = store.path("repeat-0").read_bytes()
    read = functools.partial(checkpoint.read, store, result.descents[0])
    assert survives(store.path("repeat-0"), valid, lambda _: read(), 200, "repeat-0.npz") > 100
    scene = {"object_ids": [1], "parents": [-1], "target": "boxes", "name": "a"}
    settings = {"versions": {}, "asked": {}, "runs": 1, "float64": False, "scene": scene}
    np.savez(
        tmp_path / "truth.npz", truth=np.zeros((1, 1, 4)), start=np.zeros((1, 4)), sizes=[[1, 1]]
    )
    valid = json.dumps({**settings, "configurations": []}).encode()
    assert (
        survives(tmp_path / "settings.json", valid, lambda _: Results.open(tmp_path), 200, "s") > 50
    )
    valid = (tmp_path / "truth.npz").read_bytes()
    assert (
        survives(tmp_path / "truth.npz", valid, lambda _: Results.open(tmp_path), 100, "truth") > 20
    )


def test_damaged_videos_are_read_or_refused(tmp_path):
    path = write_lossless_video(tmp_path / "clip.avi", [picture(number) for number in range(3)])

    def read(path):
        for frame in open_frames(path).frames(0):
            assert frame.dtype == np.uint8

    survives(path, path.read_bytes(), read, 100, "video")
