"""Evaluations: what they hold, what enters them, and what is refused."""

import dataclasses

import jax
import numpy as np
import pytest
from small_evaluation import (
    PARTICLES,
    RUNS,
    TWICE,
    assert_equal_bits,
    content,
    small_plan,
    small_scene,
)

import jaxpf
from jaxpf import InputError
from jaxpf.evaluation import Results, evaluate
from jaxpf.evaluation.engine import divide, keep_measures, prepare
from jaxpf.likelihoods import histogram_from_patches
from jaxpf.shapes import boxes_from_substates


@pytest.mark.slow
@pytest.mark.always
def test_results_tell_everything_about_the_evaluation(whole):
    scene = small_scene()
    results = Results.open(whole.folder)
    assert [c.label for c in results.configurations] == ["SIR", "DPS shifts"]
    assert (results.scene_name, results.runs, results.seed) == ("distracter", TWICE, 0)
    assert (results.object_ids, results.start_frame, results.fps) == ((1, 2), 0, 25.0)
    assert results.varied == ()
    np.testing.assert_array_equal(results.truth, scene.boxes[1:])
    assert results.settings["versions"]["jaxpf"] == jaxpf.__version__
    by_object, by_frame = (RUNS, 9, 2), (RUNS, 9)
    for configuration in results.configurations:
        first, second = results.batches(configuration)
        np.testing.assert_array_equal(first.runs, np.arange(RUNS))
        np.testing.assert_array_equal(second.runs, np.arange(RUNS, TWICE))
        assert {name: value.shape for name, value in vars(first).items()} == {
            **dict.fromkeys(("seeds", "runs"), (RUNS,)),
            **{"shapes": (*by_object, 4), "spread": (*by_object, 3), "model_error": (RUNS, 2, 3)},
            **dict.fromkeys(("distinct_share", "confidence", "without_likelihood"), by_object),
            **dict.fromkeys(("ess", "log_evidence"), by_frame),
        }
        assert first.shapes.dtype == np.float32
        assert first.without_likelihood.dtype == bool


def test_a_batch_holds_what_the_tracker_reported(whole):
    """Against a tracker built by hand, with keys from the seed and the run's number alone."""
    scene = small_scene()
    start = scene.boxes[0]
    tracker = jaxpf.boxes.tracker(
        None,
        start,
        likelihood=histogram_from_patches(scene.patches, method="integral"),
        ordering=jaxpf.ordering.dps(2),
        noise_pixels=(1.0, 1.0, 0.001),
        num_particles=PARTICLES,
    )
    keys = jax.vmap(lambda run: jax.random.fold_in(jax.random.key(0), run))(np.arange(RUNS, TWICE))
    frames = jax.numpy.asarray(scene.frames[1:])
    reported = jaxpf.monte_carlo(tracker, keys, frames, record=keep_measures)
    _, batch = whole.batches(whole.configurations[1])
    boxes = boxes_from_substates(reported.pop("estimate"), start[:, 2:])
    np.testing.assert_allclose(batch.shapes, boxes, rtol=1e-5, atol=1e-4)
    for name, value in reported.items():
        np.testing.assert_array_equal(getattr(batch, name), value)


def test_runs_and_configurations_differ_but_numbers_are_common(whole):
    found = content(whole)
    for index in (0, 1):
        assert len(np.unique(found[index, "shapes"].reshape(TWICE, -1), axis=0)) == TWICE
        np.testing.assert_array_equal(found[index, "seeds"], 0)
    assert not np.array_equal(found[0, "shapes"], found[1, "shapes"])


def test_a_scene_object_is_evaluated_too(tmp_path, whole):
    results = evaluate(small_plan(small_scene(), runs=RUNS), tmp_path)
    first = {name: value[:RUNS] for name, value in content(whole).items()}
    assert_equal_bits(content(results), first)


def test_imported_tracks_enter_as_one_run(tmp_path):
    scene, path = small_scene(), tmp_path / "theirs.csv"
    rows = [
        f"{frame},{number},{','.join(map(str, box))}"
        for frame, boxes in enumerate(scene.boxes)
        for number, box in enumerate(boxes, start=1)
        if (frame, number) != (4, 2)  # the tracker lost it there
    ]
    path.write_text("\n".join(["frame,id,x,y,w,h", *rows]))
    plan = small_plan(tracks={"theirs": path})
    results = evaluate(plan, tmp_path / "out")
    theirs = results.configurations[-1]
    assert (theirs.label, theirs.is_imported) == ("theirs", True)
    (batch,) = results.batches(theirs)
    expected = scene.boxes[None, 1:].astype(np.float32)
    expected[0, 3, 1] = np.nan
    np.testing.assert_allclose(batch.shapes, expected, rtol=1e-6)
    np.testing.assert_array_equal(np.argwhere(batch.without_likelihood), [[0, 3, 1]])
    for name in ("distinct_share", "spread", "ess", "log_evidence"):
        assert np.all(np.isnan(getattr(batch, name)))
    assert prepare(plan, tmp_path / "out").missing_runs == 0
    more = evaluate(small_plan(tracks={"theirs": path}, runs=TWICE), tmp_path / "out")
    assert len([*more.batches(theirs)]) == 1


def test_scenes_without_a_start_or_a_second_frame_are_refused(tmp_path):
    absent = small_scene()
    absent.boxes[0, 1] = np.nan
    with pytest.raises(InputError, match=r"object 2 has no box in the start frame \(0\)"):
        evaluate(small_plan(lambda: absent), tmp_path / "out")
    made = small_scene()
    still = dataclasses.replace(made, frames=made.frames[:1], boxes=made.boxes[:1])
    with pytest.raises(InputError, match=r"has 1 frame\(s\)"):
        evaluate(small_plan(lambda: still), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_work_is_divided_into_batches_of_one_shape_and_among_workers(tmp_path):
    plan = small_plan(runs=10_000)
    one = prepare(plan, tmp_path)
    assert one.missing_runs == 20_000
    assert not list(tmp_path.iterdir())
    small = prepare(plan, tmp_path, runs_per_batch=60)
    assert {work.blocks for work in small.work.values()} == {((2, 25),)}  # one shape, one kernel
    shared = prepare(plan, tmp_path, workers=8)
    assert len(shared.work) >= 8
    assert len(one.work) < 8
    for prepared in (one, small, shared):
        for index in (0, 1):
            runs = [
                run
                for name, work in prepared.work.items()
                if name.startswith(f"{index:04d}-")
                for run in range(work.first_run, work.first_run + work.num_runs)
            ]
            assert runs == list(range(10_000))


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="on a GPU the memory decides the widths")
def test_a_run_has_a_block_of_one_width_however_its_work_is_divided():
    """Whatever batches a kill leaves, and however many workers there are."""
    rng = np.random.default_rng(0)

    def widths(done, largest):
        found = {}
        for first, count, blocks in divide(done, largest):
            of_runs = np.repeat([w for _, w in blocks], [n * w for n, w in blocks])[:count]
            found |= dict(zip(range(first, first + count), of_runs.tolist(), strict=True))
        return found

    for runs in (1, 4, 7, 24, 25, 31, 44, 46, 133):
        whole = widths(np.zeros(runs, bool), 10**6)
        assert sorted(whole) == list(range(runs))
        for largest in (1, 7, 25, 60):
            done = np.zeros(runs, bool)
            assert widths(done, largest) == whole
            for first, count, _ in divide(done.copy(), largest):
                done[first : first + count] = rng.random() < 0.5
            left = widths(done, int(rng.integers(1, 100)))
            assert left == {run: whole[run] for run in np.flatnonzero(~done)}
