"""``jaxpf frame``: a picture to read boxes off, and the program's own help."""

import subprocess
import sys

import cv2
import numpy as np
import pytest
from command_line import jaxpf, refusal_of

from jaxpf import cli


@pytest.fixture
def images(tmp_path, monkeypatch):
    """Three frames of 64x48 pixels, each of one grey, in the present folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "images"
    folder.mkdir()
    for number in range(3):
        cv2.imwrite(str(folder / f"{number}.png"), np.full((48, 64, 3), 50 * number, np.uint8))
    return folder


def test_the_frame_is_saved_enlarged_with_a_grid(images, tmp_path):
    outcome = jaxpf("frame", images, "--number", "2")
    assert "images-frame-2.png: frame 2 of" in outcome.out
    picture = cv2.imread(str(tmp_path / "images-frame-2.png"))
    assert picture.shape == (480, 640, 3)
    values, counts = np.unique(picture, return_counts=True)
    assert values[counts.argmax()] == 100  # the frame that was asked for
    assert len(values) > 3  # lines and labels over it


def test_a_wider_step_draws_fewer_lines(images, tmp_path):
    changed = []
    for step in ("4", "32"):
        path = tmp_path / f"{step}.png"
        jaxpf("frame", images, "-n", "1", "--step", step, "-o", path)
        changed.append(np.mean(cv2.imread(str(path)) != 50))
    assert changed[0] > 2 * changed[1] > 0


def test_an_earlier_picture_is_replaced_only_if_asked(images, tmp_path):
    path = tmp_path / "frame.PNG"
    path.write_text("old")
    sentence = refusal_of("frame", images, "-o", path)
    assert "exists; choose another --output or add --overwrite" in sentence
    assert path.read_text() == "old"
    jaxpf("frame", images, "-o", path, "--overwrite")
    assert cv2.imread(str(path)) is not None


def test_what_cannot_be_saved_is_refused_and_nothing_is_written(images, tmp_path, monkeypatch):
    for arguments, message in (
        ((images, "-n", "3"), "Error: frame 3 is past the end"),
        ((images, "-o", "frame.jpg"), "output 'frame.jpg' must end in .png"),
        ((images, "-o", "no/such/frame.png"), "cannot write 'no/such/frame.png': no such file"),
        (("nowhere.mp4",), "there is no video or folder at 'nowhere.mp4'"),
        ((images, "-o", images / "x.png"), "would lie among the frames"),
    ):
        assert message in refusal_of("frame", *arguments)
    monkeypatch.chdir(images)
    assert "would lie among the frames" in refusal_of("frame", ".")
    assert [path.name for path in tmp_path.iterdir()] == ["images"]
    assert sorted(path.name for path in images.iterdir()) == ["0.png", "1.png", "2.png"]


# Help


@pytest.mark.parametrize("command", ["track", "frame", "demo"])
def test_help_names_every_option(command):
    text = " ".join(jaxpf(command, "--help").out.split())
    for option in cli.group.get_command(None, command).params:
        assert option.param_type_name != "option" or option.opts[0] in text


def test_help_lists_the_commands():
    text = jaxpf("--help").out
    for command in cli.group.list_commands(None):
        assert f"\n  {command} " in text


def printed_by(program):
    """The last line that a program prints."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version_come_without_heavy_imports(option):
    heavy = "{'jax', 'numpy', 'cv2', 'matplotlib', 'rich'}"
    program = f"import sys; from jaxpf.cli import main; main(['{option}'])"
    assert printed_by(f"{program}; print(sorted({heavy} & set(sys.modules)))") == "[]"


def test_no_help_text_loads_jax():
    program = (
        "import sys; from jaxpf.cli import group, main; commands = group.list_commands(None); "
        "[main([name, '--help']) for name in commands]; "
        "[main(['track', name, '--help']) for name in ('points', 'parts', 'contours')]; "
        "print('jax' in sys.modules)"
    )
    assert printed_by(program) == "False"
