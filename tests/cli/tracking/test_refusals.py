"""``jaxpf track``: what it says to a user who made a mistake.

``test_option_ranges.py`` has the values out of range.
"""

from functools import partial

import pytest
from clips import grey, write_pictures
from command_line import jaxpf, refusal_of
from small_video import BOXES, PARTICLES, picture, write_lossless_video, write_truth

slow = partial(pytest.param, marks=pytest.mark.slow)
NINE = ",".join("1" * 9)
BOTH = " ".join(BOXES)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ("", "--box x,y,w,h"),
        ("--box 64,2,5,5", "box of object 1 (64,2,5,5)"),
        ("--box 1,2,9,1", "box of object 1 is 9 pixels"),
        ("--box .1,.1,.2,.3 --box .5,.5,.2,.3", "multiply"),
        ("--point 9,9", "--point"),
        *(
            (f"{BOTH} {more}", named)
            for more, named in (
                ("--boxes gt.csv", "--boxes"),
                ("--ids 1", "--ids"),
                ("--start 10", "frame 10"),
                ("--target points", "target"),
                ("--set drift=none", "--set drift"),
                ("--set form=literal", "--method pffl"),
                ("--capacity 4", "--detections"),
                ("--exclusion boxes --appearance colour", "--exclusion"),
                ("--exclusion boxes --method sps", "--set swap=none"),
                ("--method eskil --set form=literal", "--set form"),
                ("--method ps --set order=0,0", "--set order 0,0"),
                ("-n 1", "--num-particles 1"),
                ("--set bands=17", "box of object 1"),
                ("--noise-pixels 1,2", "noise"),
                (f"--noise-relative {NINE}", "3 objects"),
                ("--runs 4 --tracker x.py:f", "--tracker"),
                ("--range 5,9", "--range 5,9"),
                ("more", "argument"),
            )
        ),
    ],
)
def test_options_that_do_not_go_together_are_one_sentence(refuse, arguments, named):
    assert named in refuse(*arguments.split())


def test_points_in_shares_of_the_frame_are_refused(place):
    given = ("--point", ".1,.2", "--point", ".3,.4")
    assert "multiply" in refusal_of("track", "points", place / "clip.avi", *given)


@pytest.mark.parametrize(
    "options", ["6,8,3,16", slow("2,2,60,40"), "20,20,12,16 --appearance colour"]
)
def test_a_start_from_which_nothing_can_be_learned_is_refused(refuse, tmp_path, options):
    video = write_pictures(tmp_path / "flat", [grey(110)] * 2)
    assert "box of object 1" in refuse("--box", *options.split(), video=video)


def test_what_is_no_video_is_refused(refuse, tmp_path, monkeypatch):
    sentence = refuse(*BOXES, video="nowhere.mp4")
    assert "'nowhere.mp4'" in sentence
    assert str(tmp_path) in sentence
    # Named like a kind of target, it needs its folder.
    assert "'points'" in refusal_of("track", "./points", *BOXES)
    # Before anything is compiled.
    monkeypatch.setattr("jaxpf.cli.tracking.run.use_compile_cache", lambda: 1 / 0)
    images = write_pictures(tmp_path / "one", [picture(0)])
    for one in (images, write_lossless_video(tmp_path / "one.avi", [picture(0)])):
        assert "nothing to track" in refuse(*BOXES, video=one)


def test_truth_that_says_nothing_about_the_run_is_refused_before_tracking(refuse, tmp_path):
    others = write_truth(tmp_path / "others.csv", ids=(8, 9))
    early = write_truth(tmp_path / "early.csv", last=1)
    for truth in (others, early):
        assert "no box of object 1, 2" in refuse(*BOXES, "--truth", truth)
    assert "nowhere.csv" in refuse(*BOXES, "--truth", "nowhere.csv")


def test_an_output_folder_that_cannot_be_used_stays_as_it_is(place, tmp_path):
    def said(video, output, *more):
        outcome = jaxpf("track", video, *BOXES, *PARTICLES, "-o", output, *more)
        assert outcome.code == 2
        return outcome.err

    clip, file = place / "clip.avi", tmp_path / "mine" / "tracks.csv"
    file.parent.mkdir()
    file.write_text("precious")
    assert "'tracks.csv'" in said(clip, file.parent)
    for place in (file / "out", file):
        assert str(file) in said(clip, place)
    assert file.read_text() == "precious"
    # Results are never mixed with the frames they come from.
    images = write_pictures(tmp_path / "images", [picture(0), picture(1)])
    assert "mix" in said(images, images, "--overwrite")
    assert sorted(path.name for path in images.iterdir()) == ["0.png", "1.png"]
    earlier = file.parent / "overlay.mp4"
    earlier.write_bytes(clip.read_bytes())
    said(earlier, earlier.parent, "--overwrite")
    assert earlier.read_bytes() == clip.read_bytes()
