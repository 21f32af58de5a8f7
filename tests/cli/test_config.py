"""``--config``: one TOML file that can hold every option of a command."""

import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from jaxpf import InputError, cli
from jaxpf.cli.shared import config


@pytest.fixture
def images(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    for number in range(2):
        frame = np.full((48, 64, 3), 100, np.uint8)
        frame[:8, :8] = 200
        cv2.imwrite(str(folder / f"{number}.png"), frame)
    return folder


@pytest.fixture
def refusal(tmp_path, images, monkeypatch, capsys):
    """The sentence with which ``jaxpf track`` refuses a configuration and typed options."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("jaxpf.cli.tracking.work.use_compile_cache", lambda: None)

    def run(content, *arguments):
        (tmp_path / "run.toml").write_bytes(
            content if isinstance(content, bytes) else content.encode()
        )
        with pytest.raises(SystemExit) as stop:
            cli.main(["track", str(images), "--config", "run.toml", *arguments])
        assert stop.value.code == 2
        *_, sentence = capsys.readouterr().err.strip().splitlines()
        assert sentence.startswith("Error: ")
        assert not list(tmp_path.glob("jaxpf-*"))
        return sentence

    return run


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x = [", "'run.toml' is not valid TOML"),
        (b"\xff[track]", "'run.toml' is not valid TOML"),
        ("", "has no table [track]; add one"),
        ("[demo]\nruns = 2", "has no table [track]; add one"),
        ("track = 3", "has no table [track]; add one"),
        (
            "[track]\nboxx = 3",
            "sets 'boxx' in [track], which is no option; the options are appearance,",
        ),
        ("[track]\nconfig = 'a'", "sets 'config' in [track], which is no option"),
        (
            "[track]\nparticles = 'many'",
            "sets 'particles' in [track]: 'many' is not a valid integer",
        ),
        ("[track]\nparticles = 60.7", "'60.7' is not a valid integer"),
        ("[track]\nparticles = true", "'true' is not a valid integer"),
        ("[track]\nsharpness = true", "'true' is not a valid float"),
        ("[track]\noverlay = 3", "'3' is not a valid boolean"),
        ("[track]\nmethod = 3", "method '3' is unknown"),
        ("[track]\nboxes = 3", "no file of boxes at '3'"),
        ("[track]\nscale = 4", "'4' holds 1 number(s); give 3 of them"),
        ("[track]\nscale = [4, 2]", "holds 2 number(s); give 3 of them"),
        ("[track]\nbox = ['1,2,3,4']\nids = [1]", "--ids names objects of a CSV file"),
        ("[track]\nparts_file = 'a.csv'", "--parts-file works only for parts"),
        ("[track]\ntarget = 'trees'", "target 'trees' is unknown; choose one of points,"),
        ("[track]\nids = [1.5]", "is not whole numbers separated by commas"),
        ("[track]\nbox = '6,8,12,16'\nstart = 9", "frame 9 is past the end"),
        ("[track]\nbox = [6, 8, 12, 16]", "box '6' has 1 number(s) instead of 4"),
    ],
)
def test_a_bad_configuration_is_one_sentence_that_names_file_and_key(refusal, content, message):
    assert message in refusal(content)


def test_a_configuration_that_is_not_there_is_refused(tmp_path, capsys):
    for path in (tmp_path / "nowhere.toml", tmp_path):
        with pytest.raises(SystemExit) as stop:
            cli.main(["track", "clip.avi", "--config", str(path)])
        assert stop.value.code == 2
        assert f"cannot read the configuration '{path}'" in capsys.readouterr().err


@pytest.mark.parametrize("spelling", ["ess-threshold", "ess_threshold"])
def test_keys_are_spelt_with_hyphens_or_underscores(refusal, spelling):
    assert "--ess-threshold 2 must be a finite number from 0 to 1" in refusal(
        f"[track]\n{spelling} = 2"
    ).replace("2.0", "2")


def test_the_video_may_stand_in_the_configuration(tmp_path, capsys):
    (tmp_path / "run.toml").write_text("[track]\nvideo = 'nowhere.mp4'")
    with pytest.raises(SystemExit):
        cli.main(["track", "--config", str(tmp_path / "run.toml")])
    assert "there is no video or folder at 'nowhere.mp4'" in capsys.readouterr().err


@pytest.mark.parametrize("boxes", ['["70,0,5,5"]', "[[70, 0, 5, 5]]"])
def test_boxes_may_be_texts_or_lists_of_numbers(refusal, boxes):
    assert "the box of object 1 (70,0,5,5) lies outside" in refusal(f"[track]\nbox = {boxes}")


def test_what_is_typed_wins_over_the_configuration(refusal):
    assert "--seed -2" in refusal("[track]\nseed = -1", "--seed", "-2")
    assert "'typed' is unknown" in refusal("[track]\nmethod = 'written'", "--method", "typed")


def test_boxes_that_are_typed_replace_those_of_the_configuration(refusal):
    written = "[track]\nboxes = 'nowhere.csv'\nids = [1]"
    assert "(70,0,5,5) lies outside" in refusal(written, "--box", "70,0,5,5")
    written = "[track]\nbox = [[1, 2, 3, 4]]"
    assert "no file of boxes at 'typed.csv'" in refusal(written, "--boxes", "typed.csv")


def test_a_typed_method_drops_the_order_of_the_configuration(refusal):
    written = "[track]\nmethod = 'ps'\norder = [2, 1]\nbox = [[70, 0, 5, 5]]"
    assert "lies outside" in refusal(written, "--method", "dps")
    assert "use method 'ps'" in refusal(written, "--method", "dps", "--order", "2,1")


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
    options = {
        "video": tmp_path / "a.mp4",
        "box": ("1,2,3,4",),
        "scale": [4.0, 2.0, 0.003],
        "seed": 3,
        "overlay": False,
        "ids": None,
    }
    config.write_config(tmp_path / "run.toml", "track", options)
    table = tomllib.loads((tmp_path / "run.toml").read_text())["track"]
    assert table == {
        "video": str(tmp_path / "a.mp4"),
        "box": ["1,2,3,4"],
        "scale": [4.0, 2.0, 0.003],
        "seed": 3,
        "overlay": False,
    }


@pytest.mark.parametrize("name", ["track", "evaluate", "tune", "demo"])
def test_no_two_options_of_a_command_have_one_name(name):
    command = cli.group.get_command(None, name)
    if name == "track":
        command = command.get_command(None, "boxes")
    spellings = [spelling for param in command.params for spelling in param.opts]
    assert len(set(spellings)) == len(spellings)
    assert len({param.name for param in command.params}) == len(command.params)
