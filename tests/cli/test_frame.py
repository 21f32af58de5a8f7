"""``jaxpf frame``: a picture to read boxes off, and the program's own help."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from jaxpf import cli


@pytest.fixture
def images(tmp_path):
    """Three frames of 64x48 pixels, each of one grey."""
    folder = tmp_path / "images"
    folder.mkdir()
    for number in range(3):
        cv2.imwrite(str(folder / f"{number}.png"), np.full((48, 64, 3), 50 * number, np.uint8))
    return folder


@pytest.fixture
def refuse(tmp_path, monkeypatch, capsys):
    """Run in an empty folder and get the one sentence of the refusal; nothing may be written."""
    workplace = tmp_path / "work"
    workplace.mkdir()
    monkeypatch.chdir(workplace)

    def run(*arguments):
        with pytest.raises(SystemExit) as stop:
            cli.main([str(argument) for argument in arguments])
        assert stop.value.code == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert list(workplace.iterdir()) == []
        *_, sentence = captured.err.strip().splitlines()
        assert sentence.startswith("Error: ")
        return sentence

    return run


def picture_of(path):
    return cv2.imread(str(path))


def test_the_frame_is_saved_enlarged_with_a_grid(images, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cli.main(["frame", str(images), "--number", "2"])
    assert "images-frame-2.png: frame 2 of" in capsys.readouterr().out
    picture = picture_of(tmp_path / "images-frame-2.png")
    assert picture.shape == (480, 640, 3)
    values, counts = np.unique(picture, return_counts=True)
    assert values[counts.argmax()] == 100  # the frame that was asked for
    assert len(values) > 3  # lines and labels over it


def test_a_wider_step_draws_fewer_lines(images, tmp_path):
    changed = []
    for step in ("4", "32"):
        path = tmp_path / f"{step}.png"
        cli.main(["frame", str(images), "-n", "1", "--step", step, "-o", str(path)])
        changed.append(np.mean(picture_of(path) != 50))
    assert changed[0] > 2 * changed[1] > 0


def test_an_earlier_picture_is_replaced_only_if_asked(images, tmp_path, capsys):
    path = tmp_path / "frame.PNG"
    path.write_text("old")
    with pytest.raises(SystemExit):
        cli.main(["frame", str(images), "-o", str(path)])
    assert "exists; choose another --output or add --overwrite" in capsys.readouterr().err
    assert path.read_text() == "old"
    cli.main(["frame", str(images), "-o", str(path), "--overwrite"])
    assert picture_of(path) is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-n", "-1"), "Invalid value for '--number' / '-n': -1 is not in the range 0<=x<="),
        (("-n", "3"), "Error: frame 3 is past the end"),
        (("-n", "x"), "Invalid value for '--number'"),
        (("--step", "0"), "Invalid value for '--step': 0 is not in the range 1<=x<="),
        (("-o", "frame.jpg"), "output 'frame.jpg' must end in .png"),
        (("-o", "no/such/frame.png"), "cannot write 'no/such/frame.png': no such file"),
    ],
)
def test_a_bad_option_is_refused(refuse, images, arguments, message):
    assert message in refuse("frame", images, *arguments)


def test_a_missing_video_is_refused(refuse):
    assert "there is no video or folder at 'nowhere.mp4'" in refuse("frame", "nowhere.mp4")


def test_the_picture_never_becomes_one_of_the_frames(refuse, images, monkeypatch):
    before = sorted(images.iterdir())
    assert "would lie among the frames" in refuse("frame", images, "-o", images / "x.png")
    monkeypatch.chdir(images)
    assert "would lie among the frames" in refuse("frame", ".")
    assert sorted(images.iterdir()) == before


# Help


@pytest.mark.parametrize("command", ["track", "frame", "demo"])
def test_help_explains_every_option(command, capsys):
    assert cli.main([command, "--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    options = cli.group.get_command(None, command).params
    for option in options:
        if option.param_type_name == "option":
            assert option.help, f"{option.name} has no help"
            assert option.opts[0] in text


def test_help_lists_the_commands(capsys):
    assert cli.main(["--help"]) == 0
    text = capsys.readouterr().out
    for command in cli.group.list_commands(None):
        assert f"\n  {command} " in text


def test_help_and_version_come_without_heavy_imports():
    program = (
        "import sys; from jaxpf.cli import main; main([sys.argv[1]]); "
        "print(sorted({'jax', 'numpy', 'cv2', 'matplotlib', 'rich'} & set(sys.modules)))"
    )
    for option in ("--help", "--version"):
        done = subprocess.run(
            [sys.executable, "-c", program, option], capture_output=True, text=True, check=True
        )
        assert done.stdout.endswith("[]\n")


def test_no_help_text_loads_jax():
    program = (
        "import sys; from jaxpf.cli import group, main; commands = group.list_commands(None); "
        "[main([name, '--help']) for name in commands]; "
        "[main(['track', name, '--help']) for name in ('points', 'parts', 'contours')]; "
        "print('jax' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.endswith("False\n")


def test_an_unknown_command_is_refused(refuse):
    assert "No such command 'trac'" in refuse("trac")
