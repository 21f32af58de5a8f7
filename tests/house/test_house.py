"""The proof that the house holds: what a user adds is one file, and nothing in jaxpf changes.

An ordering, a likelihood and a filter with a state of its own, each in a file beside this one, go
through ``jaxpf.monte_carlo``, ``jaxpf evaluate --tracker``, ``jaxpf track --tracker`` and, where
there is something to tune, ``jaxpf.tune``.
"""

import csv
import importlib.util
import json
from pathlib import Path

import cv2
import jax
import numpy as np
import pytest
from command_line import jaxpf as command

import jaxpf
import scenes
from jaxpf import tuning

HERE = Path(__file__).parent
#: File, function, and the most lines that it may take.
OWN = {
    "own_ordering": ("there_and_back", 15),
    "own_likelihood": ("centre_colour", 25),
    "own_filter": ("independent", 60),
}


@pytest.fixture(scope="module")
def scene():
    return scenes.make("distracter", seed=1)


def function_of(name):
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, OWN[name][0])


@pytest.mark.parametrize("name", OWN)
def test_it_is_short(name):
    lines = (HERE / f"{name}.py").read_text().splitlines()
    code = [line for line in lines if line.strip() and not line.strip().startswith(('"""', "#"))]
    assert len(code) <= OWN[name][1]


@pytest.mark.parametrize("name", OWN)
def test_it_runs_many_times(name, scene):
    tracker = function_of(name)(scene)
    keys = jax.random.split(jax.random.key(0), 3)
    estimates = jaxpf.monte_carlo(tracker, keys, scene.frames[1:6], only_estimate, batch_size=3)
    assert estimates.shape[:3] == (3, 5, scene.num_objects)
    assert np.isfinite(estimates).all()
    assert not np.array_equal(estimates[0], estimates[1])


def only_estimate(state, summary):
    return summary.estimate


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory, compiled_quickly):
    """The folder of an evaluation of all three beside a built-in method."""
    folder = tmp_path_factory.mktemp("house") / "out"
    own = [("--tracker", f"{HERE / name}.py:{OWN[name][0]}") for name in OWN]
    small = ["--set", "num_frames=10", "--set", "num_objects=3"]
    arguments = ["evaluate", "distracter", *small, "--methods", "sir", "--runs", "3", "-n", "60"]
    outcome = command(*arguments, *np.ravel(own), "-o", folder)
    assert outcome.code == 0, outcome.err
    return folder


@pytest.mark.slow
def test_they_stand_in_the_tables_beside_the_built_in_methods(evaluated):
    with (evaluated / "summary.csv").open() as file:
        rows = list(csv.DictReader(file))
    methods = {row["method"] for row in rows}
    assert methods == {"SIR", *(function for function, _ in OWN.values())}
    overlap = {
        row["method"]: float(row["value"])
        for row in rows
        if (row["object"], row["measure"]) == ("all", "overlap")
    }
    assert all(0 < value < 1 for value in overlap.values())
    # What a user's summary lacks stays empty.
    unique = {row["method"] for row in rows if row["measure"] == "uniqueness"}
    assert unique == {"SIR", "there_and_back", "centre_colour"}


def test_one_tracks_a_video(tmp_path, scene):
    for number, frame in enumerate(scene.frames[:6]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), frame[..., ::-1])
    boxes = [f"--box={','.join(map(str, box))}" for box in scene.boxes[0]]
    place = f"{HERE / 'own_filter.py'}:independent"
    arguments = ["track", tmp_path, *boxes, "--tracker", place, "--no-overlay"]
    outcome = command(*arguments, "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert len((tmp_path / "out" / "tracks.csv").read_text().splitlines()) == 6 * len(boxes)
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["frames_tracked"] == 5


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_quickly")
def test_one_is_tuned(scene):
    tracker = function_of("own_likelihood")(scene)
    sequence = tuning.TrainingSequence(tracker, np.asarray(scene.frames[1:4]), name="own")
    settings = tuning.Settings(steps=4, repeats=1, runs=2)
    result = jaxpf.tune(sequence, ["likelihood.width=0.01:1"], settings=settings)
    assert float(result.values["likelihood.width"]) != pytest.approx(0.2)


@pytest.mark.parametrize(
    ("place", "sentence"),
    [
        ("missing.py:made", "missing.py"),
        ("own_filter.py", "another form than FILE.py:FUNCTION"),
        ("own_filter.py:nothing", "has no function 'nothing'"),
        ("broken.py:fails", "ZeroDivisionError"),
        ("broken.py:wrong", "return a tracker with init and step, or boxes"),
    ],
)
def test_a_tracker_that_cannot_be_had_is_refused(place, sentence, tmp_path):
    (tmp_path / "broken.py").write_text(
        "def fails(scene):\n    return 1 / 0\n\ndef wrong(scene):\n    return 'nothing'\n"
    )
    folder = HERE if place.startswith("own") else tmp_path
    outcome = command(
        "evaluate", "distracter", "--tracker", folder / place, "-o", tmp_path / "out", "--dry-run"
    )
    assert outcome.code == 2
    assert sentence in outcome.err
    assert "Traceback" not in outcome.err
