"""``--config``: one TOML file that can hold every option of a command."""

import tomllib
from pathlib import Path

import pytest
from clips import write_pictures
from command_line import refusal_of
from small_video import picture

from jaxpf import InputError
from jaxpf.cli.shared import config


@pytest.fixture
def refusal(tmp_path, monkeypatch):
    """The sentence with which ``jaxpf track`` refuses a configuration and typed options."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("jaxpf.cli.tracking.work.use_compile_cache", lambda: None)
    images = write_pictures(tmp_path / "images", [picture(0), picture(1)])

    def run(content, *arguments):
        content = content if isinstance(content, bytes) else content.encode()
        (tmp_path / "run.toml").write_bytes(content)
        sentence = refusal_of("track", images, "--config", "run.toml", *arguments)
        assert not list(tmp_path.glob("jaxpf-*"))
        return sentence

    return run


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x = [", "'run.toml' is not valid TOML"),
        (b"\xff[track]", "'run.toml' is not valid TOML"),
        ("[track]\nruns = " + "[" * 20_000, "is nested too deeply"),
        ("[track]\nruns = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
        ('[track]\noutput = "a\\u0000b"', "holds a NUL"),
        ("[track]\nseed = '" + "y" * 5000 + "'", "[track]: 'yyyy"),
        ("[demo]\nruns = 2", "has no table [track]; add one"),
        ("track = 3", "has no table [track]; add one"),
        (
            "[track]\nboxx = 3",
            "sets 'boxx' in [track], which is not an option; the options are appear",
        ),
        ("[track]\nconfig = 'a'", "sets 'config' in [track], which is not an option"),
        (
            "[track]\nnum_particles = 'many'",
            "sets 'num_particles' in [track]: 'many' is not a valid int",
        ),
        ("[track]\noverlay = 3", "'3' is not a valid boolean"),
        ("[track]\nnoise_pixels = [4, 2]", "holds 2 number(s); give 3 of them"),
        ("[track]\nbox = [6, 8, 12, 16]", "box '6' has 1 number(s) instead of 4"),
        ("[track]\nbox = [[70, 0, 5, 5]]", "the box of object 1 (70,0,5,5) lies outside"),
        ("[track]\nbox = ['70,0,5,5']", "the box of object 1 (70,0,5,5) lies outside"),
        ("[track]\ness_threshold = 2", "--ess-threshold 2 must be a finite number from 0 to 1"),
        ("[track]\nparts = 'a.csv'", "--parts works only for parts"),
        ("[track]\ntarget = 'trees'", "target 'trees' is unknown; choose one of points,"),
    ],
)
def test_a_bad_configuration_is_one_sentence_that_names_file_and_key(refusal, content, message):
    assert message in refusal(content)


def test_a_file_or_a_video_that_is_not_there_is_refused(tmp_path):
    for path in (tmp_path / "nowhere.toml", tmp_path):
        sentence = refusal_of("track", "clip.avi", "--config", path)
        assert f"cannot read the configuration '{path}'" in sentence
    (tmp_path / "run.toml").write_text("[track]\nvideo = 'nowhere.mp4'")
    sentence = refusal_of("track", "--config", tmp_path / "run.toml")
    assert "there is no video or folder at 'nowhere.mp4'" in sentence


@pytest.mark.parametrize(
    ("written", "typed", "message"),
    [
        ("seed = -1", "--seed -2", "--seed -2"),
        ("method = 'written'", "--method typed", "'typed' is unknown"),
        # Typed boxes replace all that says where objects start.
        ("boxes = 'nowhere.csv'\nids = [1]", "--box 70,0,5,5", "(70,0,5,5) lies outside"),
        ("box = [[1, 2, 3, 4]]", "--boxes typed.csv", "no file of boxes at 'typed.csv'"),
        # A typed method drops the written order, and not a typed one.
        ("method = 'ps'\norder = [2, 1]\nbox = [[70, 0, 5, 5]]", "--method dps", "lies outside"),
        ("method = 'ps'", "--box 1,2,9,9 --method dps --order 2,1", "use method 'ps'"),
    ],
)
def test_what_is_typed_wins_over_the_configuration(refusal, written, typed, message):
    assert message in refusal(f"[track]\n{written}", *typed.split())


def test_the_output_of_the_configuration_is_used(refusal, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("")
    written = "[track]\noutput = 'mine'\nappearance = 'colour'\nbox = [[1, 2, 9, 9]]"
    assert "output folder 'mine' is not empty" in refusal(written)


def test_a_name_that_is_not_utf_8_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\\udcff.*is not UTF-8.*rename"):
        config.write_config(tmp_path / "run.toml", "track", {"boxes": Path("a\udcff.csv")})
    assert not list(tmp_path.iterdir())


def test_what_is_written_reads_back_as_the_same_options(tmp_path):
    """``test_properties.py`` writes values of every kind; paths become text, None is left out."""
    options = {"video": tmp_path / "a.mp4", "box": ("1,2,3,4",), "overlay": False, "ids": None}
    config.write_config(tmp_path / "run.toml", "track", options)
    table = tomllib.loads((tmp_path / "run.toml").read_text())["track"]
    assert table == {"video": str(tmp_path / "a.mp4"), "box": ["1,2,3,4"], "overlay": False}
