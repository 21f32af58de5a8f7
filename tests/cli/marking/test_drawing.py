"""What the page writes: only its own files, never over what it has not read, nothing unreadable."""

import json
import os
import subprocess
import time
from pathlib import Path

import pytest
from clips import grey, write_pictures

from jaxpf import InputError
from jaxpf.cli.marking.drawing import Marking
from jaxpf.cli.shared.flags import write_config
from jaxpf.files.store import locked
from jaxpf.media.page.runs import Run
from jaxpf.media.page.server import Conflict

SQUARE = [[9.0, 9.0], [40.0, 9.0], [40.0, 40.0], [9.0, 40.0]]
#: Start files of other programs, by hand or by a run, each of which the page would change.
FOREIGN = {
    "MOT truth": ("boxes", "1,1,21,21,16,24,1,1,1\n4,1,27,21,16,24,1,1,0.5\n1,2,61,21,9,9,0,8,1\n"),
    "MOT tracks": ("boxes", "1,1,21,21,16,24,1,-1,-1,-1\n"),
    "whole tracks": ("boxes", "".join(f"{t},1,21,21,16,24\n" for t in range(1, 9))),
    "occlusion": ("boxes", "frame,id,x,y,w,h,occ\n0,1,20,20,16,24,1\n"),
    "tracks of a run": ("boxes", "frame,time,id,x,y,w,h,lost\n0,0.0,1,20,20,16,24,0\n"),
    "absent object": ("boxes", "frame,id,x,y,w,h\n0,1,20,20,16,24\n1,1,0,0,0,0\n"),
    "no boxes": ("boxes", "a note to myself\n"),
    "named points": ("points", "x,y,name\n20,20,nose\n"),
    "bare points": ("points", "20,20\n30,30\n"),
    "no parts": ("parts", "part,x,y\narm,20,20\n"),
    "four points": ("contours", json.dumps({"closed": True, "contours": {"1": SQUARE}})),
    "bent": ("contours", json.dumps({"closed": True, "degree": 2, "contours": {"1": SQUARE * 4}})),
    "settings": ("contours", '{"colour": "red"}'),
    "empty": ("boxes", ""),
}  # fmt: skip
SHAPES = {
    "boxes": {"x": 50.0, "y": 20.0, "w": 16.0, "h": 24.0},
    "points": {"x": 50.0, "y": 20.0},
    "parts": {"x1": 9.0, "y1": 9.0, "x2": 40.0, "y2": 9.0, "width": 6.0, "parent": ""},
    "contours": {"points": SQUARE, "closed": True, "width": None},
}


def shape(kind, name="7", frame=0, **changes):
    return {"kind": kind, "name": name, "frame": frame, **SHAPES[kind], **changes}


def box(name, frame=0, **changes):
    return shape("boxes", name, frame, **changes)


@pytest.fixture
def started(monkeypatch):
    """The commands of runs, which are not run."""
    commands = []

    class Started:
        def __init__(self, command, **_):
            commands.append(command)

        def poll(self):
            return 0

    monkeypatch.setattr(subprocess, "Popen", Started)
    return commands


@pytest.fixture
def clip(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_pictures(tmp_path / "clip", [grey(20 * n, (96, 64)) for n in range(4)])


def marked_to(clip, kind, text):
    path = clip.parent / f"given{'.json' if kind == 'contours' else '.csv'}"
    path.write_text(text)
    return path, Marking(str(clip), kind, path)


def marked_beside(clip, kind, text):
    path = Marking(str(clip), kind, None).file(kind)
    path.write_text(text)
    return path, Marking(str(clip), kind, None)


def viewed(clip, kind, text):
    path = clip.parent / "given.txt"
    path.write_text(text)
    (clip.parent / "run").mkdir()
    table = {"video": clip, "target": kind, kind: path, "num_particles": 9}
    write_config(clip.parent / "run" / "run.toml", "track", table)
    run = Run(clip.parent / "run")
    return path, Marking(str(clip), kind, None, 0, run)


def draw(marking, kind, **more):
    shapes = [one for one in marking.about()["items"] if one["kind"] == kind]
    new = shape(kind, str(7 + len(shapes)))
    marking.save({"kind": kind, "items": [*shapes, new], **more})


def draw_over(marking, kind):
    try:
        draw(marking, kind)
    except Conflict as refusal:
        draw(marking, kind, digest=refusal.content["digest"])


def delete_all(marking, kind):
    marking.save({"kind": kind, "items": [], "digest": marking.about()["digests"].get(kind, "")})


def track(marking, kind):
    digest = marking.about()["digests"].get(kind, "")
    marking.track({"kind": kind, "items": [shape(kind)], "digest": digest, "replaces": True})


@pytest.mark.parametrize("name", FOREIGN)
@pytest.mark.parametrize("opened", [marked_to, marked_beside, viewed])
def test_files_that_the_page_did_not_write_stay_as_they_are(clip, started, name, opened):
    kind, text = FOREIGN[name]
    path, marking = opened(clip, kind, text)
    beside = sorted(os.listdir(path.parent))
    for way in (draw, draw_over, track, delete_all):
        refused = ""
        try:
            way(marking, kind)
        except InputError as error:
            refused = str(error)
        # Only a review has a file of its own, if it can read where objects started.
        assert (opened is viewed and not refused) or str(path) in refused
        assert path.read_text() == text
        assert sorted(os.listdir(path.parent)) == beside


def test_corrections_are_kept_in_the_results_and_found_again(clip):
    _, marking = viewed(clip, "boxes", FOREIGN["whole tracks"][1])
    (start,) = marking.about()["items"]
    assert (start["frame"], start["name"], start["x"]) == (0, "1", 20)
    saved = marking.save({"kind": "boxes", "items": [start, box("1", 2)]})
    assert f"--boxes {saved['file']}" in saved["command"]
    again = Marking(str(clip), "boxes", None, 0, Run(clip.parent / "run"))
    assert [one["frame"] for one in again.about()["items"]] == [0, 2]
    # Another run into the same folder, which does not start from them.
    later = time.time() + 9
    os.utime(clip.parent / "run" / "run.toml", (later, later))
    anew = Marking(str(clip), "boxes", None, 0, Run(clip.parent / "run"))
    assert anew.about()["items"] == [start]
    with pytest.raises(Conflict) as refusal:
        anew.save({"kind": "boxes", "items": [start], "digest": ""})
    assert len(refusal.value.content["items"]) == 2


def test_objects_of_a_detector_are_not_corrected(clip):
    _, marking = viewed(clip, "boxes", FOREIGN["whole tracks"][1])
    marking.reviewed.table["detections"] = "det.txt"
    with pytest.raises(InputError, match="a run with --detections cannot be corrected here"):
        marking.save({"kind": "boxes", "items": [box("1")], "digest": ""})
    assert not marking.file("boxes").exists()


@pytest.mark.parametrize("kind", SHAPES)
def test_a_file_that_changed_is_neither_lost_nor_overwritten_unasked(clip, kind):
    one, other = (Marking(str(clip), kind, None) for _ in range(2))
    first = one.save({"kind": kind, "items": [shape(kind, "1")], "digest": ""})
    mine = {"kind": kind, "items": [shape(kind, "2")], "digest": ""}
    with pytest.raises(Conflict) as refusal:
        other.save(mine)
    theirs = refusal.value.content
    assert [item["name"] for item in theirs["items"]] == ["1"]
    assert theirs["digest"] == first["digest"] == one.about()["digests"][kind]
    other.save(mine | {"digest": theirs["digest"]})
    assert [item["name"] for item in one.about()["items"]] == ["2"]
    with pytest.raises(Conflict):
        one.save({"kind": kind, "items": [], "digest": first["digest"]})
    one.file(kind).unlink()
    with pytest.raises(Conflict) as refusal:
        one.save(mine | {"digest": theirs["digest"]})
    assert refusal.value.content["items"] == []


WRONG = {
    "boxes": (
        *({"w": -5.0}, {"w": 0.0}, {"h": 0.0}, {"x": float("nan")}, {"y": float("inf")}),
        *({"x": 1e12}, {"name": "\N{SUPERSCRIPT TWO}"}, {"name": "head"}, {"name": "01"}),
        *({"name": "9" * 30}, {"frame": 1.5}, {"frame": -1}),
    ),
    "points": ({"name": "a\nb"}, {"name": ""}, {"x": float("nan")}),
    "parts": ({"width": 0.0}, {"parent": "nobody"}, {"frame": 1.5}),
    "contours": ({"points": [[9.0, 9.0], [40.0, 9.0]]}, {"name": "a\0"}),
}


@pytest.mark.parametrize(
    ("kind", "wrong"), [(kind, wrong) for kind, every in WRONG.items() for wrong in every]
)
def test_a_shape_that_could_not_be_read_again_is_refused_and_others_are_kept(clip, kind, wrong):
    marking = Marking(str(clip), kind, None)
    first = marking.save({"kind": kind, "items": [shape(kind, "1")], "digest": ""})
    drawn = [shape(kind, "2") | wrong, shape(kind, "3")]
    with pytest.raises(Conflict) as refused:
        marking.save({"kind": kind, "items": drawn, "digest": first["digest"]})
    assert refused.value.status == 400
    assert f"'{drawn[0]['name']}'" in f"{refused.value}" or kind != "boxes"
    kept = marking.about()
    right_alone = kind == "parts" and "width" not in wrong  # and wrong beside the other
    what_is_right = {"1"} if right_alone else {"1", "3"}
    assert {one["name"] for one in kept["items"]} == what_is_right
    assert kept["digests"][kind] == refused.value.content["digest"]


def test_incomplete_files_of_killed_saves_are_removed(clip):
    left, of_others = (
        clip.parent / f".{name}.1a2b.partial.csv" for name in ("clip-boxes", "other")
    )
    for path in (left, of_others):
        path.touch()
    Marking(str(clip), "boxes", None)
    assert [path.exists() for path in (left, of_others)] == [False, True]


def test_results_are_replaced_only_when_asked(clip, started):
    marking = Marking(str(clip), "boxes", None)
    content = {"kind": "boxes", "items": [box("1")]}
    digest = marking.save(content)["digest"]
    marking.folder.mkdir()
    (marking.folder / ".lock").touch()  # of a killed run
    marking.track(content | {"digest": digest})
    assert len(started) == 1
    (marking.folder / "tracks.csv").touch()
    with pytest.raises(Conflict):
        marking.track(content | {"digest": digest})
    assert len(started) == 1
    marking.track(content | {"digest": digest, "replaces": True})
    assert len(started) == 2


def test_a_run_of_another_program_is_found_and_not_replaced(clip, started):
    marking = Marking(str(clip), "boxes", None)
    content = {"kind": "boxes", "items": [box("1")]}
    assert not marking.progress({})["running"]
    with locked(marking.folder, "tracking", keep=False):
        assert marking.progress({}) == {"running": True, "text": "", "failed": False}
        with pytest.raises(Conflict):
            marking.track(content)
        with pytest.raises(InputError):
            marking.track(content | {"replaces": True})
    assert started == []
    assert not marking.progress({})["running"]


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a folder that nobody may change")
def test_a_folder_that_cannot_be_written_is_told_in_a_sentence(clip, started, monkeypatch):
    monkeypatch.chdir("/proc/self")
    content = {"kind": "boxes", "items": [box("1")]}
    Marking(str(clip), "boxes", None).track(content)
    assert len(started) == 1  # it says itself that it cannot write its results
    with pytest.raises(Conflict, match="cannot write 'starts"):
        Marking(str(clip), "boxes", Path("starts.csv")).save(content)
