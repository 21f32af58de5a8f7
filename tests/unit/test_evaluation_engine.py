"""Evaluations: the same results however they are computed, resumed, and never mixed."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from small_evaluation import PARTICLES, RUNS, small_plan, small_scene

import jaxpf
from jaxpf import InputError
from jaxpf.evaluation import Limits, Results, batches, evaluate, finished, prepare, store
from jaxpf.evaluation.execution import local_pool
from jaxpf.evaluation.worker import keep_measures
from jaxpf.files import writing as files
from jaxpf.models.geometry import boxes_from_substates
from jaxpf.models.likelihoods import histogram_from_patches
from jaxpf.targets.boxes import box_tracker

HERE = Path(__file__).parent
#: Two files per configuration.
TWICE = 2 * RUNS
#: One compiled batch per file.
ONE = Limits(runs_per_batch=RUNS)


def content(results):
    """Every array of every run, by configuration; batches joined."""
    found = {}
    for index, configuration in enumerate(results.configurations):
        parts = list(results.batches(configuration))
        for name in vars(parts[0]):
            found[index, name] = np.concatenate([getattr(part, name) for part in parts])
    return found


def assert_equal_bits(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=str(name))
        assert one[name].dtype == other[name].dtype


def names(folder):
    return sorted(path.name for path in (folder / "batches").iterdir())


def stamps(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "batches").iterdir()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """An uninterrupted evaluation of two files per configuration."""
    folder = tmp_path_factory.mktemp("whole")
    return evaluate(small_plan(runs=TWICE), folder, limits=ONE)


@pytest.fixture
def part(tmp_path, whole):
    """A folder with the first half of the same evaluation."""
    return evaluate(small_plan(runs=RUNS), tmp_path / "part", limits=ONE).folder


def test_results_tell_everything_about_the_evaluation(whole):
    scene = small_scene()
    results = Results.open(whole.folder)
    assert [c.label for c in results.configurations] == ["SIR", "DPS shifts"]
    assert (results.scene_name, results.runs, results.seed) == ("distracter", TWICE, 0)
    assert results.object_ids == (1, 2)
    assert (results.start_frame, results.fps) == (0, 25.0)
    assert results.varied == ()
    np.testing.assert_array_equal(results.truth, scene.boxes[1:])
    assert results.settings["versions"]["jaxpf"] == jaxpf.__version__
    for configuration in results.configurations:
        np.testing.assert_allclose(results.noise_scale(configuration), [1, 1, 0.001])
        assert results.finished(configuration) == TWICE
        first, second = results.batches(configuration)
        np.testing.assert_array_equal(first.runs, np.arange(RUNS))
        np.testing.assert_array_equal(second.runs, np.arange(RUNS, TWICE))
        shapes = {name: value.shape for name, value in vars(first).items()}
        assert shapes == {
            "seeds": (RUNS,),
            "runs": (RUNS,),
            "boxes": (RUNS, 9, 2, 4),
            "uniqueness": (RUNS, 9, 2),
            "spread": (RUNS, 9, 2, 3),
            "ess": (RUNS, 9),
            "log_evidence": (RUNS, 9),
            "lost": (RUNS, 9, 2),
        }
        assert first.boxes.dtype == np.float32
        assert first.lost.dtype == bool
    np.testing.assert_array_equal(whole.scene().frames, scene.frames)


def test_a_batch_holds_what_the_tracker_reported(whole):
    """Against a tracker built by hand, with keys from the seed and the run's number alone."""
    import jax

    scene = small_scene()
    start = scene.boxes[0]
    tracker = box_tracker(
        histogram_from_patches(scene.patches, method="integral"),
        start,
        jaxpf.ordering.dps(2),
        scale=(1.0, 1.0, 0.001),
        num_particles=PARTICLES,
    )
    keys = jax.numpy.stack(
        [jax.random.fold_in(jax.random.key(0), run) for run in range(RUNS, TWICE)]
    )
    frames = jax.numpy.asarray(scene.frames[1:])
    reported = jaxpf.monte_carlo(tracker, keys, frames, record=keep_measures)
    _, batch = whole.batches(whole.configurations[1])
    boxes = boxes_from_substates(reported.pop("estimate"), start[:, 2:])
    np.testing.assert_allclose(batch.boxes, boxes, rtol=1e-5, atol=1e-4)
    for name, value in reported.items():
        np.testing.assert_array_equal(getattr(batch, name), value)


def test_runs_and_configurations_differ_but_numbers_are_common(whole):
    found = content(whole)
    for index in (0, 1):
        assert len(np.unique(found[index, "boxes"].reshape(TWICE, -1), axis=0)) == TWICE
        np.testing.assert_array_equal(found[index, "seeds"], 0)
    assert not np.array_equal(found[0, "boxes"], found[1, "boxes"])


@pytest.mark.slow
def test_the_size_of_batches_does_not_matter(whole, tmp_path):
    together = evaluate(small_plan(runs=TWICE), tmp_path, limits=Limits(runs_per_batch=1000))
    assert len(names(tmp_path)) == 2
    assert_equal_bits(content(together), content(whole))


@pytest.mark.slow
def test_two_processes_give_the_same_bits(whole, tmp_path):
    from jaxpf.cli.common import use_compile_cache

    done = []
    results = evaluate(
        small_plan(runs=TWICE),
        tmp_path,
        limits=ONE,
        executor=local_pool(2, 1, use_compile_cache),
        progress=done.append,
    )
    assert done == [RUNS] * 4
    assert_equal_bits(content(results), content(whole))


@pytest.mark.slow
def test_dask_gives_the_same_bits(whole, tmp_path):
    distributed = pytest.importorskip(
        "distributed", reason="needs Dask: pip install jaxpf[cluster]"
    )
    from jaxpf.cli.common import use_compile_cache

    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(use_compile_cache)
        plan = small_plan(runs=TWICE)
        results = evaluate(plan, tmp_path, limits=ONE, executor=client.get_executor)
    assert_equal_bits(content(results), content(whole))


@pytest.mark.slow
@pytest.mark.parametrize("devices", [1, 2])
def test_the_number_of_devices_does_not_matter(whole, tmp_path, devices):
    code = f"""
import jax
jax.config.update("jax_num_cpu_devices", {devices})
from jaxpf.cli.common import use_compile_cache
use_compile_cache()
from jaxpf.evaluation import Limits, evaluate
from small_evaluation import small_plan
assert jax.device_count() == {devices}
evaluate(small_plan(runs={TWICE}), {str(tmp_path)!r})
"""
    subprocess.run([sys.executable, "-c", code], cwd=HERE, check=True)
    assert_equal_bits(content(Results.open(tmp_path)), content(whole))


def test_a_finished_evaluation_is_told_without_its_scene_or_jax(whole):
    code = f"""
import sys
from small_evaluation import small_plan
from jaxpf.evaluation import finished
assert finished(small_plan(runs={TWICE}), {str(whole.folder)!r}) is not None
assert finished(small_plan(runs={TWICE + 1}), {str(whole.folder)!r}) is None
assert "jax" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], cwd=HERE, check=True)

    def unopened():
        raise AssertionError("the scene was opened")

    before = stamps(whole.folder)
    assert finished(small_plan(runs=TWICE), whole.folder) is not None
    with pytest.raises(InputError, match="function"):
        finished(small_plan(unopened, runs=TWICE), whole.folder)
    evaluate(small_plan(runs=TWICE), whole.folder)
    assert stamps(whole.folder) == before


def test_more_runs_are_added_to_those_there_are(whole, part):
    before = stamps(part)
    results = evaluate(small_plan(runs=TWICE), part, limits=ONE)
    assert results.runs == TWICE
    assert before.items() <= stamps(part).items()
    assert_equal_bits(content(results), content(whole))


def test_only_missing_runs_are_done_again(whole, part):
    evaluate(small_plan(runs=TWICE), part, limits=ONE)
    missing = part / "batches" / names(part)[1]
    missing.unlink()
    before = stamps(part)
    done = []
    assert finished(small_plan(runs=TWICE), part) is None
    results = evaluate(small_plan(runs=TWICE), part, limits=ONE, progress=done.append)
    assert done == [RUNS]
    assert before.items() <= stamps(part).items()
    assert_equal_bits(content(results), content(whole))


@pytest.mark.parametrize("harm", ["truncated", "altered", "emptied", "other", "shorter"])
def test_a_damaged_batch_is_found_and_done_again(whole, part, harm):
    path = part / "batches" / names(part)[0]
    data = path.read_bytes()
    intact = content(Results.open(part))
    if harm == "truncated":
        path.write_bytes(data[: len(data) // 2])
    elif harm == "altered":
        middle = len(data) // 2
        path.write_bytes(data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :])
    elif harm == "emptied":
        path.write_bytes(b"")
    elif harm == "other":
        np.savez(path, something=np.zeros(3))
    else:
        with np.load(path) as arrays:
            kept = {name: arrays[name] for name in arrays}
        np.savez(path, **(kept | {"boxes": kept["boxes"][:, :-1]}))
    prepared = prepare(small_plan(), part)
    assert (prepared.damaged, prepared.missing_runs) == ([path], RUNS)
    assert finished(small_plan(), part) is None
    results = evaluate(small_plan(), part)
    assert finished(small_plan(), part) is not None
    assert_equal_bits(content(results), intact)


def test_no_alteration_of_a_file_goes_unnoticed(part):
    """Every byte that matters is under a checksum; the rest changes nothing."""
    path = part / "batches" / names(part)[0]
    data, intact = path.read_bytes(), batches.read_batch(path)
    rng = np.random.default_rng(0)
    noticed = 0
    for place in rng.integers(0, len(data), 200):
        altered = bytes([data[place] ^ (1 << rng.integers(8))])
        path.write_bytes(data[:place] + altered + data[place + 1 :])
        try:
            found = batches.read_batch(path)
        except InputError:
            noticed += 1
            continue
        for name, value in vars(intact).items():
            np.testing.assert_array_equal(getattr(found, name), value)
    assert noticed > 150


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"seed": 1}, "was begun with seed = 0, now 1"),
        ({"sharpness": [20, 30]}, "was begun with sharpness = 20, now 20,30"),
        ({"methods": ["sir"]}, "was begun with methods = sir,dps, now sir"),
        ({"particles": [PARTICLES + 1]}, f"with particles = {PARTICLES}, now {PARTICLES + 1}"),
        ({"runs": RUNS - 1}, f"was begun with runs = {RUNS}, now {RUNS - 1}"),
    ],
)
def test_changed_settings_are_refused_by_name_with_both_values(part, change, sentence):
    before = stamps(part)
    with pytest.raises(InputError) as error:
        evaluate(small_plan(**change), part)
    assert sentence in str(error.value)
    assert f"'{part}'" in str(error.value)
    assert stamps(part) == before


def test_another_scene_is_refused(part):
    import functools

    other = functools.partial(small_scene.func, **(small_scene.keywords | {"seed": 1}))
    with pytest.raises(InputError, match="was begun with scene: seed = 0, now 1"):
        evaluate(small_plan(other), part)


def test_a_scene_that_changed_on_disk_is_refused(tmp_path, monkeypatch, whole):
    """Its description is the same, its pictures are not."""
    evaluate(small_plan(the_scene), tmp_path / "results")
    monkeypatch.setattr(sys.modules[__name__], "brightness", 1)
    with pytest.raises(InputError, match="has other pictures or boxes than when"):
        evaluate(small_plan(the_scene, runs=TWICE), tmp_path / "results")
    assert len(names(tmp_path / "results")) == 2


brightness = 0


def the_scene():
    scene = small_scene()
    scene.frames[3] += np.uint8(brightness)
    return scene


def test_a_scene_object_is_evaluated_too(tmp_path, whole):
    results = evaluate(small_plan(small_scene(), runs=RUNS), tmp_path)
    first = {name: value[:RUNS] for name, value in content(whole).items()}
    assert_equal_bits(content(results), first)
    assert results.scene().name == "distracter"


def test_another_precision_is_refused(part):
    import jax

    with (
        jax.enable_x64(True),
        pytest.raises(InputError, match="begun in single precision, now double"),
    ):
        evaluate(small_plan(runs=TWICE), part)


def test_another_version_is_refused(part):
    path = part / store.SETTINGS
    settings = json.loads(path.read_text())
    settings["versions"]["jaxpf"] = "0.0.9"
    path.write_text(json.dumps(settings))
    with pytest.raises(InputError, match=r"made by jaxpf 0\.0\.9 and this is jaxpf"):
        evaluate(small_plan(), part)


@pytest.mark.parametrize("text", ["{", "[]", "{}", ""])
def test_damaged_settings_are_refused(part, text):
    (part / store.SETTINGS).write_text(text)
    with pytest.raises(InputError, match=r"settings\.json"):
        evaluate(small_plan(), part)


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match=r"holds 'thesis\.tex' but no evaluation"):
        evaluate(small_plan(), tmp_path)
    with pytest.raises(InputError, match="is a file"):
        evaluate(small_plan(), tmp_path / "thesis.tex")
    with pytest.raises(InputError, match="holds no evaluation"):
        Results.open(tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "precious"


def test_batches_without_settings_are_refused(part):
    (part / store.SETTINGS).unlink()
    with pytest.raises(InputError, match=r"holds 'batches' but no evaluation"):
        evaluate(small_plan(), part)


def test_two_processes_cannot_evaluate_into_one_folder(part):
    with (
        store.locked(part),
        pytest.raises(InputError, match="another process is evaluating into"),
    ):
        evaluate(small_plan(runs=TWICE), part)
    assert evaluate(small_plan(runs=TWICE), part, limits=ONE).runs == TWICE


def test_errors_while_the_folder_is_locked_are_not_mistaken_for_its_own(tmp_path):
    with pytest.raises(FileNotFoundError, match="elsewhere"), store.locked(tmp_path):
        raise FileNotFoundError("elsewhere")
    with store.locked(tmp_path):  # it was given back
        pass


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot write into the folder"):
        evaluate(small_plan(), tmp_path / "file" / "below")


def test_a_full_disk_is_one_sentence_and_finished_batches_stay(whole, tmp_path, monkeypatch):
    """The disk fills up while the third of four batches is written."""
    replace, replaced = os.replace, []

    def full(source, target):
        if str(target).endswith(".npz") and "batches" in str(target):
            replaced.append(target)
            if len(replaced) == 3:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return replace(source, target)

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(InputError, match="no space left on device") as error:
        evaluate(small_plan(runs=TWICE), tmp_path, limits=ONE)
    assert "\n" not in str(error.value)
    monkeypatch.undo()
    assert len(names(tmp_path)) == 2
    before = stamps(tmp_path)
    results = evaluate(small_plan(runs=TWICE), tmp_path, limits=ONE)
    assert before.items() <= stamps(tmp_path).items()
    assert_equal_bits(content(results), content(whole))


def test_leavings_of_a_killed_start_do_not_stand_in_the_way(whole, tmp_path):
    (tmp_path / "batches").mkdir()
    (tmp_path / store.LOCK).touch()
    (tmp_path / ".settings.77.partial.json").write_text("{")
    leaving = tmp_path / "batches" / ".0000-00000000.77.partial.npz"
    results = evaluate(small_plan(), tmp_path)
    leaving.write_bytes(b"half")
    assert finished(small_plan(), tmp_path) is not None
    results = evaluate(small_plan(runs=TWICE), tmp_path, limits=ONE)
    assert not leaving.exists()
    assert_equal_bits(content(results), content(whole))


@pytest.mark.slow
def test_killing_it_loses_only_the_batch_in_flight(whole, tmp_path):
    """SIGKILL, again and again, whenever two more batches are on disk."""
    runs = 40 * RUNS
    code = f"""
from jaxpf.cli.common import use_compile_cache
use_compile_cache()
from jaxpf.evaluation import Limits, evaluate
from small_evaluation import small_plan
evaluate(small_plan(runs={runs}), {str(tmp_path)!r}, limits=Limits(runs_per_batch={RUNS}))
"""
    known: dict[str, int] = {}
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-c", code], cwd=HERE)
        deadline = time.monotonic() + 120
        while len(list(tmp_path.glob("batches/0*.npz"))) < len(known) + 2:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
        found = {n: t for n, t in stamps(tmp_path).items() if not n.startswith(".")}
        assert known.items() <= found.items()  # nothing was done twice
        assert len(found) < 80
        known = found
        for name in known:
            assert len(batches.read_batch(tmp_path / "batches" / name)) == RUNS
    results = evaluate(small_plan(runs=runs), tmp_path, limits=ONE)
    assert known.items() <= stamps(tmp_path).items()
    found = content(results)
    np.testing.assert_array_equal(found[1, "runs"], np.arange(runs))
    first = {name: value[:TWICE] for name, value in found.items()}
    assert_equal_bits(first, content(whole))


def test_imported_tracks_enter_as_one_run(whole, tmp_path):
    scene = small_scene()
    lines = ["frame,id,x,y,w,h"]
    for frame, boxes in enumerate(scene.boxes):
        for number, box in enumerate(boxes, start=1):
            if (frame, number) != (4, 2):  # the tracker lost it there
                lines.append(",".join(map(str, [frame, number, *box])))
    path = tmp_path / "theirs.csv"
    path.write_text("\n".join(lines))
    plan = small_plan(tracks={"theirs": path})
    results = evaluate(plan, tmp_path / "out")
    theirs = results.configurations[-1]
    assert (theirs.label, theirs.is_imported, results.finished(theirs)) == ("theirs", True, 1)
    (batch,) = results.batches(theirs)
    expected = scene.boxes[None, 1:].astype(np.float32)
    expected[0, 3, 1] = np.nan
    np.testing.assert_allclose(batch.boxes, expected, rtol=1e-6)
    np.testing.assert_array_equal(np.argwhere(batch.lost), [[0, 3, 1]])
    for name in ("uniqueness", "spread", "ess", "log_evidence"):
        assert np.all(np.isnan(getattr(batch, name)))
    assert np.all(np.isnan(results.noise_scale(theirs)))
    assert finished(plan, tmp_path / "out") is not None
    more = evaluate(small_plan(tracks={"theirs": path}, runs=TWICE), tmp_path / "out")
    assert more.finished(theirs) == 1


def test_an_object_absent_at_the_start_is_named(tmp_path):
    def scene():
        made = small_scene()
        made.boxes[0, 1] = np.nan
        return made

    with pytest.raises(InputError, match=r"object 2 has no box in the start frame \(0\)"):
        evaluate(small_plan(scene), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_single_frame_is_refused(tmp_path):
    import dataclasses

    def scene():
        made = small_scene()
        return dataclasses.replace(made, frames=made.frames[:1], boxes=made.boxes[:1])

    with pytest.raises(InputError, match=r"has 1 frame\(s\)"):
        evaluate(small_plan(scene), tmp_path / "out")


@pytest.mark.parametrize("name", ["memory", "workers", "runs_per_batch", "devices"])
def test_limits_below_one_are_refused(name):
    with pytest.raises(InputError, match=f"{name} = 0 must be at least 1"):
        Limits(**{name: 0})


def test_work_is_divided_to_the_memory_budget_and_among_workers(tmp_path):
    plan = small_plan(runs=10_000)
    one = prepare(plan, tmp_path)
    assert one.missing_runs == 20_000
    assert not list(tmp_path.iterdir())
    tight = prepare(plan, tmp_path, Limits(memory=10 * 2**20))
    assert tight.memory < one.memory
    assert max(work.width for work in tight.work) < max(work.width for work in one.work)
    assert len({work.width for work in tight.work}) == 1  # one shape, one kernel
    shared = prepare(plan, tmp_path, Limits(workers=8))
    assert len(shared.work) >= 8
    assert len(one.work) < 8
    for prepared in (one, tight, shared):
        for index in (0, 1):
            runs = [
                run
                for work in prepared.work
                if work.index == index
                for run in range(work.first_run, work.first_run + work.num_runs)
            ]
            assert runs == list(range(10_000))


@pytest.mark.slow
def test_memory_does_not_grow_with_the_runs(tmp_path):
    """Peak memory of 4000 runs and of 40 000 in batches of one size."""

    def peak(runs):
        code = f"""
import resource
from jaxpf.cli.common import use_compile_cache
use_compile_cache()
from jaxpf.evaluation import Limits, evaluate
from small_evaluation import small_plan
evaluate(small_plan(runs={runs}, methods=["sir"], particles=[4]), {str(tmp_path / str(runs))!r},
         limits=Limits(runs_per_batch=2000))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
        ran = subprocess.run(
            [sys.executable, "-c", code], cwd=HERE, check=True, stdout=subprocess.PIPE, text=True
        )
        return int(ran.stdout) * 1024

    peak(2000)  # compiles, which takes more memory than anything after it
    few, many = peak(4000), peak(40_000)
    results = Results.open(tmp_path / "40000")
    kept = sum(path.stat().st_size for path in (results.folder / "batches").iterdir())
    assert kept > 25e6
    print(few, many, kept)
    assert many - few < 0.3 * kept
