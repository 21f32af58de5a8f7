"""``jaxpf tune``: values that track and evaluate take, resumed, refused in one sentence."""

import shlex
import tomllib

import cv2
import jax
import numpy as np
import pytest
from command_line import jaxpf, refusal_of
from small_evaluation import small_scene
from small_sequence_folder import SMALL, write_sequence

WRITTEN = {"tuned.toml", "tuning.png", "run.toml", "settings.json", "repeat-0.npz"}
#: Every successful call has these shapes, so that the filter is compiled once.
QUICK = shlex.split(
    "-n 20 --runs 2 --method sir --gradient none --repeats 1 --window 2 --noise-pixels 1,1,0.001"
)
SCENE = ("tune", "distracter", *SMALL, *QUICK, "--train-scenes", "1")


def written_in(folder, name="tuned.toml"):
    return tomllib.loads((folder / name).read_text())


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """A folder with the output of a tuning on the small scene, its outcome and its arguments."""
    output = tmp_path_factory.mktemp("tune") / "out"
    arguments = (*SCENE, "--steps", "4", "-o", output)
    return output, jaxpf(*arguments), arguments


@pytest.mark.slow
def test_it_prints_values_and_writes_them(tuned):
    output, outcome, _ = tuned
    assert outcome.code == 0, outcome.err
    for words in ("Tuned values", "likelihood.sharpness", "dynamics.scale[1]"):
        assert words in outcome.out
    assert {path.name for path in output.iterdir()} == WRITTEN
    content = written_in(output)
    value = content["tuned"]["likelihood.sharpness"]["value"]
    assert content["track"]["sharpness"] == value != 20.0
    assert content["evaluate"]["sharpness"] == [value]
    assert content["evaluate"]["noise_pixels"] == [content["track"]["noise_pixels"]]
    assert content["track"]["noise_pixels"][2] == 0.001
    assert cv2.imread(str(output / "tuning.png")).shape[0] > 300
    *_, last = outcome.out.splitlines()
    command = shlex.split(last.partition(": jaxpf ")[2])
    assert command[:4] == ["evaluate", "distracter", "--scene-seed", "1"]
    assert jaxpf(*command, "--dry-run").code == 0


@pytest.mark.slow
def test_the_same_command_continues_and_another_is_refused(tuned):
    output, _, arguments = tuned
    before = (output / "tuned.toml").read_bytes()
    again = jaxpf(*arguments)
    assert again.code == 0, again.err
    assert (output / "tuned.toml").read_bytes() == before
    other = jaxpf(*arguments, "--learning-rate", "0.3")
    assert other.code == 2
    assert "was begun with learning_rate = 0.1, now 0.3" in other.err
    assert other.err.count("Error") == 1


@pytest.mark.slow
def test_evaluate_and_track_take_the_values(tuned, tmp_path):
    config = ("--config", tuned[0] / "tuned.toml", "-n", "20")
    of_runs = ("--methods", "sir", "--runs", "2", "-o", tmp_path / "evaluated")
    evaluated = jaxpf("evaluate", "distracter", *SMALL, *config, *of_runs)
    assert evaluated.code == 0, evaluated.err
    values = written_in(tuned[0])["evaluate"]
    written = written_in(tmp_path / "evaluated", "run.toml")["evaluate"]
    assert written["sharpness"] == values["sharpness"]
    assert written["noise_pixels"] == values["noise_pixels"]

    folder = write_sequence(tmp_path / "two")
    box = ",".join(str(float(x)) for x in small_scene().boxes[0, 0])
    of_run = ("--box", box, "--no-overlay", "-o", tmp_path / "tracked")
    tracked = jaxpf("track", folder, *of_run, *config)
    assert tracked.code == 0, tracked.err
    written = written_in(tmp_path / "tracked", "run.toml")["track"]
    assert written["sharpness"] == values["sharpness"][0]
    assert written["noise_pixels"] == values["noise_pixels"][0]


@pytest.mark.slow
def test_a_folder_is_tuned_on_its_first_frames(tmp_path):
    folder = write_sequence(tmp_path / "two")
    options = "--objective iou --steps 2 --labels 1 --frames 3 --appearance colour"
    parameters = ("--parameters", "likelihood.sharpness=1:100", "-o", tmp_path / "out")
    outcome = jaxpf("tune", folder, *QUICK, *options.split(), *parameters)
    assert outcome.code == 0, outcome.err
    assert f"jaxpf evaluate {folder} --start-frame 3 --config" in outcome.out
    content = written_in(tmp_path / "out")
    # A sharpness is that of an appearance, here not of the usual one.
    assert set(content["track"]) == {"sharpness", "appearance"}
    assert content["track"]["appearance"] == "colour"
    # A single repeat tells nothing about the error, which is not a zero.
    assert "standard_error" not in content["tuned"]["likelihood.sharpness"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ("--parameters likelihood.sharp", "likelihood.sharpness"),
        ("--parameters dynamics.momentum", "option"),
        ("--frames 3", "--frames 3"),
        ("--labels 5", "--labels 5"),
        ("--labels 99 --objective position", "--labels 99"),
        ("--method eskil", "--method eskil"),
    ],
)
def test_a_mistake_is_one_sentence(tmp_path, arguments, named):
    assert named in refusal_of(*SCENE, "-o", tmp_path / "out", *arguments.split())
    assert not (tmp_path / "out").exists()


@pytest.fixture
def diverging(monkeypatch):
    """Losses are made up, and the third is no number."""
    losses = iter([1.0, 0.9, np.nan])

    def value_and_gradient(free, *_):
        return next(losses), jax.tree.map(np.ones_like, free)

    monkeypatch.setattr("jaxpf.tuning.loop.free_loss", lambda *_: value_and_gradient)


@pytest.mark.usefixtures("diverging")
@pytest.mark.parametrize(
    "options",
    ["--appearance colour --motion relative", pytest.param("", marks=pytest.mark.slow)],
)
def test_a_clip_is_tuned_with_the_default_parameters(tmp_path, options):
    """Filmed objects move by relative steps, whose default depends on the number of objects."""
    folder = write_sequence(tmp_path / "two")
    given = (*QUICK[:-2], "--steps", "4", *options.split())
    outcome = jaxpf("tune", folder, *given, "-o", tmp_path / "out")
    assert outcome.code == 2
    *_, sentence = outcome.err.strip().splitlines()
    assert "the loss became no number on " in sentence
    assert "step 3, repeat 1" in sentence
    assert "They are kept in" in sentence
    usual, long, size = written_in(tmp_path / "out")["track"]["noise_relative"]
    assert size == 0.02
    assert 0 < usual != 0.045
    assert 0 < long != 0.18
    many = ("--frames", "500", "-o", tmp_path / "none")
    assert "--frames 500" in refusal_of("tune", folder, *QUICK, *many)


@pytest.mark.slow
def test_parts_are_tuned_on_their_outlines(tmp_path):
    """A target without boxes: its own options are written."""
    options = shlex.split(
        "--set num_frames=6 --set num_parts=3 --method sir --set likelihood=patch --objective iou "
        "--parameters dynamics.scale --num-particles 20 --runs 2 --repeats 1 --window 2 --steps 2 "
        "--train-scenes 1"
    )
    outcome = jaxpf("tune", "articulated", *options, "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert len(written_in(tmp_path / "out")["track"]["noise_pixels"]) == 3
