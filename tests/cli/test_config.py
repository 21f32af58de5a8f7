"""``--config``: one TOML file that can hold every option of a command."""

import functools
from pathlib import Path

import pytest
from clips import write_pictures
from command_line import asked_of_track, refusal_of
from small_video import picture

from jaxpf import InputError
from jaxpf.cli.shared import flags


@pytest.fixture
def refusal(tmp_path, monkeypatch):
    """The sentence with which ``jaxpf track`` refuses a configuration and typed options."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("jaxpf.cli.tracking.run.use_compile_cache", lambda: None)
    images = write_pictures(tmp_path / "images", [picture(0), picture(1)])

    def run(content, *arguments):
        content = content if isinstance(content, bytes) else content.encode()
        (tmp_path / "run.toml").write_bytes(content)
        sentence = refusal_of("track", images, "--config", "run.toml", *arguments)
        assert not list(tmp_path.glob("jaxpf-*"))
        return sentence

    return run


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("x = [", "TOML"),
        (b"\xff[track]", "TOML"),
        ("[track]\nruns = " + "[" * 20_000, "nested"),
        ("[track]\nruns = " + "9" * 5000, "TOML"),
        ('[track]\noutput = "a\\u0000b"', "NUL"),
        ("[track]\nseed = '" + "y" * 5000 + "'", "'yyyy"),
        ("[demo]\nruns = 2", "[track]"),
        ("track = 3", "[track]"),
        ("[track]\nboxx = 3", "'boxx'"),
        ("[track]\nconfig = 'a'", "'config'"),
        ("[track]\nnum_particles = 'many'", "'many'"),
        ("[track]\noverlay = 3", "'3'"),
        ("[track]\nnoise_pixels = [4, 2]", "2 number"),
        ("[track]\nbox = [6, 8, 12, 16]", "box '6'"),
        ("[track]\nbox = [[70, 0, 5, 5]]", "(70,0,5,5)"),
        ("[track]\nbox = ['70,0,5,5']", "(70,0,5,5)"),
        ("[track]\ness_threshold = 2", "--set ess_threshold=2"),
        ("[track]\nparts = 'a.csv'", "'parts'"),
        ("[track]\ntarget = 'trees'", "'trees'"),
    ],
    ids=range(19),
)
def test_a_bad_configuration_is_one_sentence_that_names_file_and_key(refusal, content, named):
    assert named in refusal(content)


def test_a_file_or_a_video_that_is_not_there_is_refused(tmp_path):
    for path in (tmp_path / "nowhere.toml", tmp_path):
        sentence = refusal_of("track", "clip.avi", "--config", path)
        assert f"cannot read the configuration '{path}'" in sentence
    (tmp_path / "run.toml").write_text("[track]\nvideo = 'nowhere.mp4'")
    sentence = refusal_of("track", "--config", tmp_path / "run.toml")
    assert "there is no video or folder at 'nowhere.mp4'" in sentence


@pytest.mark.parametrize(
    ("written", "typed", "asked"),
    [
        ("seed = 1", "--seed 2", {"run.seed": 2}),
        ("seed = 1", "", {"run.seed": 1, "options.method": "dps"}),
        ("method = 'sir'", "--method ps", {"options.method": "ps"}),
        # Typed boxes replace all that says where objects start.
        (
            "boxes = 'nowhere.csv'\nids = [1]",
            "--box 7,0,5,5",
            {"starts": {"box": ("7,0,5,5",), "boxes": None, "ids": None, "detections": None}},
        ),
        ("box = [[1, 2, 3, 4]]", "--boxes typed.csv", {"starts.boxes": Path("typed.csv")}),
        # A typed method drops the written order, and not a typed one.
        (
            "method = 'ps'\norder = [2, 1]",
            "--method dps",
            {"options.order": None, "options.method": "dps"},
        ),
        ("order = [2, 1]", "--method ps", {"options.order": (1, 0)}),
    ],
    ids=range(7),
)
def test_what_is_typed_wins_over_the_configuration(tmp_path, monkeypatch, written, typed, asked):
    monkeypatch.chdir(tmp_path)
    Path("run.toml").write_text(f"[track]\n{written}")
    request = asked_of_track("boxes", "clip.avi", "--config", "run.toml", *typed.split())
    for name, value in asked.items():
        found = functools.reduce(
            lambda one, key: one[key] if isinstance(one, dict) else getattr(one, key),
            name.split("."),
            request,
        )
        assert found == value, name


def test_a_typed_order_that_a_typed_method_has_not_is_refused(refusal):
    assert "only with --method ps" in refusal(
        "[track]\nmethod = 'ps'", *["--method", "dps", "--set", "order=2,1"]
    )


def test_the_output_of_the_configuration_is_used(refusal, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("")
    written = "[track]\noutput = 'mine'\nappearance = 'colour'\nbox = [[1, 2, 9, 9]]"
    assert "output folder 'mine' is not empty" in refusal(written)


def test_a_name_that_is_not_utf_8_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\\udcff.*is not UTF-8.*rename"):
        flags.write_config(tmp_path / "run.toml", "track", {"boxes": Path("a\udcff.csv")})
    assert not list(tmp_path.iterdir())
