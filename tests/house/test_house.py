"""The proof that the house holds: what a user adds is one file, and nothing in jaxpf changes.

An ordering, a likelihood, a filter with a state of its own and a resampling scheme, each in a file
beside this one, go through ``jaxpf.monte_carlo``, ``jaxpf evaluate --tracker``, ``jaxpf track
--tracker`` and, where there is something to tune, ``jaxpf.tune``.
"""

import importlib.util
import json
from functools import partial
from pathlib import Path

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from command_line import jaxpf as command
from csv_rows import rows_of
from models import walks
from records import only_estimate, only_evidence
from scipy.stats import multivariate_normal

import jaxpf
import scenes
from jaxpf import resampling, tuning
from jaxpf.filters import registry

HERE = Path(__file__).parent
#: File, function, and the most lines that it may take.
OWN = {
    "own_ordering": ("there_and_back", 15),
    "own_likelihood": ("centre_colour", 25),
    "own_filter": ("independent", 60),
    "own_resampling": ("shuffled", 25),
}


@pytest.fixture(autouse=True)
def apart(monkeypatch):
    """What the files register is forgotten."""
    monkeypatch.setattr(registry, "_REGISTERED", {})


@pytest.fixture(scope="module")
def scene():
    return scenes.make("distracter", seed=1)


def function_of(name, attribute=None):
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, attribute or OWN[name][0])


@pytest.mark.parametrize("name", OWN)
def test_it_is_short(name):
    lines = (HERE / f"{name}.py").read_text().splitlines()
    code = [line for line in lines if line.strip() and not line.strip().startswith(('"""', "#"))]
    assert len(code) <= OWN[name][1]


@pytest.mark.parametrize(
    "name", [n for n in OWN if n != "own_resampling"]
)  # with a scheme of their own filters run many times below
@pytest.mark.slow
@pytest.mark.always
def test_it_runs_many_times(name, scene):
    tracker = function_of(name)(scene)
    keys = jax.random.split(jax.random.key(0), 3)
    estimates = jaxpf.monte_carlo(tracker, keys, scene.frames[1:6], only_estimate, batch_size=3)
    assert estimates.shape[:3] == (3, 5, scene.num_objects)
    assert np.isfinite(estimates).all()
    assert not np.array_equal(estimates[0], estimates[1])


@pytest.mark.parametrize(
    "sizes", [[0, 3, 4, 1], *(pytest.param(s, marks=pytest.mark.slow) for s in ([8], [8, 0]))]
)
def test_a_scheme_is_unbiased_within_components(sizes):
    """Of n slots of a component, particle i has ``n w_i`` on average, and none without weight."""
    scheme = function_of("own_resampling", "Shuffled")()
    weights = np.float32([0.02, 0.3, 0.0, 0.13, 0.07, 0.21, 0.1, 0.27])
    components = resampling.components_of_sizes(np.array(sizes), 8)
    keys = jax.random.split(jax.random.key(0), 20_000)

    @jax.jit
    def ancestors(keys):
        draw = partial(resampling.ancestors, scheme=scheme, components=components)
        return jax.vmap(lambda key: draw(key, jnp.log(weights)))(keys)

    chosen = np.asarray(ancestors(keys))
    index = np.asarray(components.index)
    assert (index[chosen] == index).all()
    offspring = (chosen[..., None] == np.arange(8)).sum(axis=1)
    share = weights / np.bincount(index, weights)[index]
    expected = share * np.asarray(sizes)[index]
    error = np.maximum(offspring.std(0) / len(keys) ** 0.5, 1e-9)
    assert (np.abs(offspring.mean(0) - expected) < 4.5 * error + 1e-6).all()
    assert not offspring[:, weights == 0].any()


@pytest.mark.parametrize(
    "kind",
    [
        "dps",
        pytest.param("labelled", marks=pytest.mark.always),
        pytest.param("factored", marks=pytest.mark.always),
    ],
)
@pytest.mark.slow
def test_a_scheme_leaves_the_evidence_of_every_filter_unbiased(kind):
    frames = np.float32([[[0.3], [-1.0]], [[1.2], [-0.4]], [[0.1], [0.9]]])
    own = function_of("own_resampling", "Shuffled")()
    model = walks() | {"num_particles": 10, "resampling": own}
    if kind == "dps":
        tracker = jaxpf.Partitioned(ordering=jaxpf.ordering.dps(2), **model)
    elif kind == "factored":
        tracker = jaxpf.PFFL(**model)
    else:
        tracker = jaxpf.Labelled(weights="plain", **model)
    times = np.arange(1, 4)
    covariance = np.minimum(times[:, None], times) + np.eye(3)
    each = [multivariate_normal.pdf(frames[:, part, 0], np.zeros(3), covariance) for part in (0, 1)]
    expected = np.mean(each) if isinstance(tracker, jaxpf.Labelled) else np.prod(each)
    keys = jax.random.split(jax.random.key(1), 4000)
    logs = jaxpf.monte_carlo(tracker, keys, frames, only_evidence, batch_size=4000)
    found = np.exp(np.asarray(logs).sum(axis=1))
    assert abs(found.mean() - expected) < 4.5 * found.std() / len(keys) ** 0.5


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
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
    rows = rows_of(evaluated / "summary.csv")
    methods = {row["method"] for row in rows}
    assert methods == {"SIR", *(function for function, _ in OWN.values())}
    iou = {
        row["method"]: float(row["value"])
        for row in rows
        if (row["object"], row["measure"]) == ("all", "iou")
    }
    assert all(0 < value < 1 for value in iou.values())
    # What a user's summary lacks stays empty.
    unique = {row["method"] for row in rows if row["measure"] == "distinct_share"}
    assert unique == {"SIR", "there_and_back", "centre_colour", "shuffled"}


def test_one_tracks_a_video(tmp_path, scene):
    for number, frame in enumerate(scene.frames[:6]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), frame[..., ::-1])
    boxes = [f"--box={','.join(map(str, box))}" for box in scene.boxes[0]]
    place = f"{HERE / 'own_filter.py'}:independent"
    arguments = ["track", tmp_path, *boxes, "--tracker", place, "--no-overlay"]
    outcome = command(*arguments, "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert len((tmp_path / "out" / "tracks.csv").read_text().splitlines()) == 1 + 6 * len(boxes)
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["frames_tracked"] == 5


def test_a_registered_filter_is_a_method(scene):
    function_of("own_filter")
    made = jaxpf.points.tracker(scene.frames[0], [[20, 20]], method="swarms", num_particles=7)
    assert (type(made).__name__, made.num_particles) == ("Independent", 7)
    assert "swarms (a filter for each object)" in " ".join(command("track", "--help").out.split())
    outcome = command("track", "no.mp4", "--method", "swarms", "-n", "0")
    assert "--num-particles 0 must be a whole number" in outcome.err


@pytest.mark.slow
def test_one_is_tuned(scene):
    tracker = function_of("own_likelihood")(scene)
    sequence = tuning.TrainingSequence(tracker, np.asarray(scene.frames[1:4]), name="own")
    settings = tuning.Settings(steps=4, repeats=1, runs=2)
    result = jaxpf.tune(sequence, ["likelihood.width=0.01:1"], settings=settings)
    assert float(result.values["likelihood.width"]) != pytest.approx(0.2)


@pytest.mark.parametrize(
    ("place", "named"),
    [
        ("missing.py:made", "missing.py"),
        ("own_filter.py", "FILE.py:FUNCTION"),
        ("own_filter.py:nothing", "'nothing'"),
        ("broken.py:fails", "ZeroDivisionError"),
        ("broken.py:wrong", "a tracker with init and step"),
        ("broken.py:text", "cannot be made"),
    ],
)
def test_a_tracker_that_cannot_be_had_is_refused(place, named, tmp_path):
    (tmp_path / "broken.py").write_text(
        "def fails(scene):\n    return 1 / 0\n\ndef wrong(scene):\n    return 'nothing'\n"
        "import numpy\n\ndef text(scene):\n    return numpy.array(['x'])\n"
    )
    folder = HERE if place.startswith("own") else tmp_path
    outcome = command(
        "evaluate", "distracter", "--tracker", folder / place, "-o", tmp_path / "out", "--dry-run"
    )
    assert outcome.code == 2
    assert named in outcome.err
    assert "Traceback" not in outcome.err
