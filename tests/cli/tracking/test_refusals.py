"""``jaxpf track``: what it says to a user who made a mistake."""

import re

import numpy as np
import pytest
from command_line import jaxpf
from small_video import BOXES, PARTICLES, picture, write_images, write_truth

from jaxpf import cli

# Bad input


@pytest.mark.parametrize(
    ("box", "arguments", "message"),
    [
        ("6,8,3,16", (), "the box of object 1 is 3 pixels wide and 16 high"),
        ("2,2,60,40", (), "the box of object 1 lies on one colour"),
        ("20,20,12,16", ("--appearance", "colour"), "the box of object 1 lies on one colour"),
    ],
)
def test_a_start_from_which_nothing_can_be_learned_is_refused(
    refuse, tmp_path, box, arguments, message
):
    frames = [np.full((48, 64, 3), 110, np.uint8)] * 2
    video = write_images(tmp_path / "flat", frames)
    assert message in refuse("--box", box, *arguments, video=video)


def test_a_missing_video_is_named_with_the_current_folder(refuse, tmp_path):
    sentence = refuse(*BOXES, video="nowhere.mp4")
    assert "there is no video or folder at 'nowhere.mp4'" in sentence
    assert str(tmp_path) in sentence


@pytest.mark.parametrize(
    ("arguments", "note"),
    [
        (
            ("--likelihood", "sampled", "--sharpness", "5"),
            "Note: --likelihood and --sharpness set --appearance colour, which reports no "
            "confidence; the default is discriminative.\n",
        ),
        (("--scale", "3,3,.01"), "Note: --scale sets --motion pixels; the default is relative.\n"),
        (("--sharpness", "5", "--appearance", "colour"), ""),
        (("--momentum", ".2"), ""),
        ((), ""),
    ],
)
def test_options_that_change_others_say_so_in_one_line(arguments, note):
    outcome = jaxpf("track", "nowhere.mp4", *BOXES, *arguments)
    notes, _, refusal = outcome.err.partition("Error:")
    assert refusal
    assert notes == note


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("empty.mp4", b"", "is empty"),
        ("junk.mp4", bytes(range(256)) * 20, "is not a video; give a video"),
        ("stub.avi", b"RIFF\x00\x00\x00\x00AVI LIST" + bytes(99), "begins as AVI but is cut off"),
        ("text.mp4", b"hello\n" * 50, "is not a video; give a video"),
    ],
)
def test_a_file_that_is_no_video_is_refused(refuse, tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    assert message in refuse(*BOXES, video=tmp_path / name)


def test_a_folder_without_images_is_refused(refuse, tmp_path):
    (tmp_path / "none").mkdir()
    assert "holds no images" in refuse(*BOXES, video=tmp_path / "none")


def test_sizes_that_differ_at_once_leave_no_folder(refuse, tmp_path):
    mixed = write_images(tmp_path / "mixed", [picture(0), picture(1)[:40]])
    assert "mixes image sizes" in refuse(*BOXES, video=mixed)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no start box: give --box x,y,w,h"),
        (("--box", "1,2,3"), "box '1,2,3' has 3 number(s) instead of 4"),
        (("--box", "1,2,a,4"), "box '1,2,a,4' holds 'a', which is not a finite number"),
        (("--box", "1,2,nan,4"), "holds 'nan', which is not a finite number"),
        (("--box", "1,2,0,4"), "has the size 0 x 4; both must be positive"),
        (("--box", "64,2,5,5"), "the box of object 1 (64,2,5,5) lies outside the 64x48 frame"),
        (("--box", "1,2,9,1"), "the box of object 1 is 9 pixels wide and 1 high"),
        ((*BOXES, "--boxes", "gt.csv"), "--box and --boxes were both given"),
        ((*BOXES, "--ids", "1"), "--ids names objects of a CSV file"),
        ((*BOXES, "--start", "-1"), "--start -1 must be a whole number from 0 to 2147483647"),
        ((*BOXES, "--start", "10"), "frame 10 is past the end"),
        ((*BOXES, "--start", "x"), "Invalid value for '--start'"),
        ((*BOXES, "--frames", "0"), "--frames 0 must be a whole number from 1"),
        (("--point", "9,9"), "--point works only for points; write `jaxpf track points"),
        ((*BOXES, "--target", "points"), "name the kind of target before the video"),
        ((*BOXES, "--start", "9" * 20), "must be a whole number from 0 to 2147483647"),
        ((*BOXES, "--drift", "none"), "--drift works only for factored, not for partitioned"),
        ((*BOXES, "--exclusion", "boxes", "--appearance", "colour"), "--exclusion goes with"),
        ((*BOXES, "--exclusion", "boxes", "--method", "sps"), "use --swap none"),
        ((*BOXES, "-n", "0"), "--particles 0 must be a whole number from 1"),
        ((*BOXES, "-n", "1"), "--particles 1 is fewer than the 2 components of dps"),
        ((*BOXES, "-n", "1" + 12 * "0"), "must be a whole number from 1 to 2147483647"),
        ((*BOXES, "--method", "foo"), "'foo' is unknown; choose one of sir, ps, dps, sps"),
        ((*BOXES, "--relocate", "2"), "--relocate 2 must be a finite number from 0 to 1"),
        ((*BOXES, "--relocate", "0.1", "--appearance", "colour"), "--appearance discriminative"),
        ((*BOXES, "--swap", "foo"), "choose one of none, random, sorted, combinatorial"),
        ((*BOXES, "--resampling", "foo"), "choose one of systematic, stratified"),
        ((*BOXES, "--likelihood", "foo"), "choose one of auto, integral, sampled"),
        (
            (*BOXES, "--method", "sir", "--swap", "sorted"),
            "--swap goes with --method sps, and sir",
        ),
        ((*BOXES, "--method", "pffl", "--drift", "none"), "--drift goes with --method eskil"),
        (
            (*BOXES, "--method", "eskil", "--form", "literal"),
            "--form goes with --method pffl",
        ),
        ((*BOXES, "--order", "2,1"), "method 'dps' has none; use method 'ps'"),
        ((*BOXES, "--method", "ps", "--order", "0,0"), "--order 0,0 counts from 1"),
        (
            (*BOXES, "--method", "ps", "--order", "1"),
            "the order 1 is not a permutation of the 2 object(s)",
        ),
        ((*BOXES, "--method", "ps", "--order", "0,x"), "'0,x' is not whole numbers"),
        ((*BOXES, "--seed", "-1"), "--seed -1 must be a whole number from 0 to 4294967295"),
        ((*BOXES, "--seed", "4294967296"), "must be a whole number from 0 to 4294967295"),
        ((*BOXES, "--sharpness", "nan"), "--sharpness nan must be a finite number above 0"),
        ((*BOXES, "--sharpness", "0"), "--sharpness 0 must be a finite number above 0"),
        ((*BOXES, "--parts", "0"), "--bands 0 must be a whole number from 1"),
        ((*BOXES, "--parts", "17"), "the box of object 1 is 12.0 pixels wide and 16.0 high"),
        ((*BOXES, "--scale", "1,2"), "holds 2 number(s); give 3 of them"),
        ((*BOXES, "--scale", "1,2,-1"), "must be three finite numbers of at least 0"),
        (
            (*BOXES, "--relative-scale", "1,2,3,4"),
            "three finite numbers, or three for every object",
        ),
        ((*BOXES, "--relative-scale", ",".join("1" * 9)), "is for 3 objects, and there are 2"),
        ((*BOXES, "--ess-threshold", "2"), "must be a finite number from 0 to 1"),
        ((*BOXES, "--bogus"), "No such option"),
        ((*BOXES, "more"), "Got unexpected extra argument"),
    ],
)
def test_a_bad_option_is_one_sentence_that_names_the_value(refuse, arguments, message):
    assert message in refuse(*arguments)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "frame,id,x,y,w,h\n0,1,6,8,12,16\n0,2,a,3,4,5\n",
            "line 3 of 'boxes.csv': x is 'a', which is not a finite number",
        ),
        ("1,1,7,9,12,16,1\n1,2,7,9,12\n", "line 2 of 'boxes.csv' has 5 columns"),
        (
            "frame,id,x,y,w,h\n0,1,6,8,0,16\n",
            "has no box in frame 0; choose a start frame among none",
        ),
        ("frame,id,x,y,w,h\n3,1,6,8,9,16\n", "has no box in frame 0; choose a start frame among 3"),
        ("id;x;y\n", "'boxes.csv' begins with 'id,x,y'"),
        ("", "'boxes.csv' holds no boxes"),
    ],
)
def test_a_bad_file_of_boxes_is_refused_by_its_line(refuse, tmp_path, content, message):
    (tmp_path / "boxes.csv").write_text(content)
    assert message in refuse("--boxes", "boxes.csv")


def test_an_unknown_id_is_refused_with_those_that_exist(refuse, place):
    sentence = refuse("--boxes", place / "gt.csv", "--ids", "1,7")
    assert "id 7 has no box in frame 0" in sentence
    assert "the ids there are 1, 2" in sentence


def test_truth_that_says_nothing_about_the_run_is_refused_before_tracking(refuse, tmp_path):
    others = write_truth(tmp_path / "others.csv", ids=(8, 9))
    assert "has no box of object 1, 2, which this run tracks" in refuse(*BOXES, "--truth", others)
    early = write_truth(tmp_path / "early.csv", last=1)
    assert "has no box of object 1, 2, which this run tracks" in refuse(*BOXES, "--truth", early)
    assert "there is no file of boxes at" in refuse(*BOXES, "--truth", "nowhere.csv")


def test_an_output_folder_in_use_is_refused_and_stays_as_it_is(track, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "tracks.csv").write_text("precious")
    outcome = track(*BOXES)
    assert outcome.code == 2
    assert "is not empty (it holds 'tracks.csv'); choose another folder" in outcome.err
    assert (tmp_path / "out" / "tracks.csv").read_text() == "precious"


def test_an_output_folder_that_cannot_be_made_is_refused(place, tmp_path):
    (tmp_path / "file").write_text("")
    run = ("track", place / "clip.avi", *BOXES, *PARTICLES)
    outcome = jaxpf(*run, "-o", tmp_path / "file" / "out")
    assert outcome.code == 2
    assert "cannot create the output folder" in outcome.err
    outcome = jaxpf(*run, "-o", tmp_path / "file")
    assert outcome.code == 2
    assert "is a file; choose another folder" in outcome.err


def test_results_are_never_mixed_with_the_frames_they_come_from(place, tmp_path):
    images = write_images(tmp_path / "images", [picture(0), picture(1)])
    outcome = jaxpf("track", images, *BOXES, *PARTICLES, "-o", images, "--overwrite")
    assert outcome.code == 2
    assert "would mix the results with the video" in outcome.err
    assert sorted(path.name for path in images.iterdir()) == ["0.png", "1.png"]

    (tmp_path / "earlier").mkdir()
    clip = tmp_path / "earlier" / "overlay.mp4"
    clip.write_bytes((place / "clip.avi").read_bytes())
    outcome = jaxpf("track", clip, *BOXES, *PARTICLES, "-o", clip.parent, "--overwrite")
    assert outcome.code == 2
    assert clip.stat().st_size > 0


def test_a_video_named_like_a_kind_of_target_needs_its_folder():
    assert "there is no video or folder at 'points'" in jaxpf("track", "./points", *BOXES).err


def test_a_clip_of_one_frame_is_refused_before_anything_is_compiled(refuse, tmp_path, monkeypatch):
    monkeypatch.setattr("jaxpf.cli.tracking.work.use_compile_cache", lambda: 1 / 0)
    one = write_images(tmp_path / "one", [picture(0)])
    assert "follows the start frame 0, so there is nothing to track" in refuse(*BOXES, video=one)


@pytest.mark.parametrize("target", ["boxes", "points", "parts", "contours"])
def test_help_fits_on_a_screen_and_explains_everything_on_request(target, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    shown = jaxpf("track", target, "--help").out
    assert len(shown.splitlines()) <= 60
    every = jaxpf("track", target, "--help-all").out
    for param in cli.group.get_command(None, "track").get_command(None, target).params:
        if param.name != "video":
            assert param.opts[0] in every
            # Options of filter families that this kind of target rarely needs are left out.
            assert (param.opts[0] in re.split(r"[\s,]+", shown)) == getattr(param, "is_named", True)
    assert "--regularise" not in shown
