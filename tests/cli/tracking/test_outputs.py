"""``jaxpf track``: what it writes, and that it repeats."""

import re
import shutil
import tomllib

import numpy as np
import pytest
from command_line import assert_same, built_by_track, jaxpf, started_by_track
from small_video import (
    BOXES,
    HEIGHT,
    LENGTH,
    PARTICLES,
    STAMPS,
    WIDTH,
    rows_of,
    summary_of,
    true_boxes,
    write_truth,
)

from jaxpf import measures, ordering
from jaxpf.boxes import read_boxes, read_tracks
from jaxpf.cli.tracking import results
from jaxpf.cli.tracking.command import command
from jaxpf.contract.lost import LOST_BELOW
from jaxpf.contract.options import options_of
from jaxpf.detections import Rules
from jaxpf.files import states
from jaxpf.filters import filter_of
from jaxpf.filters.registry import all_filters
from jaxpf.media import open_frames
from jaxpf.sequences.tables import dense

# What a run writes


def test_a_run_writes_these_files_and_no_others(whole_run):
    names = "diagnostics.csv metrics.csv overlay.mp4 run.toml summary.json tracks.csv"
    expected = [*names.split(), "trajectories.png"]
    assert sorted(path.name for path in whole_run[1].iterdir()) == expected


def test_tracks_are_one_tidy_table_that_begins_with_the_given_boxes(whole_run):
    table = read_tracks(whole_run[1] / "tracks.csv")
    assert list(table) == [
        *("frame", "time", "id", "x", "y", "w", "h"),
        *(f"{name}_{level}" for name in "xywh" for level in ("2.5", "97.5")),
        *(f"centre_{name}_{level}" for name in "xy" for level in ("2.5", "97.5")),
        *("speed", "speed_2.5", "speed_97.5", "confidence", "lost"),
    ]
    np.testing.assert_array_equal(table["frame"], np.repeat(np.arange(LENGTH), 2))
    np.testing.assert_array_equal(table["id"], np.tile([1, 2], LENGTH))
    np.testing.assert_allclose(table["time"], table["frame"] / 25)
    truth = np.concatenate([true_boxes(number) for number in range(LENGTH)])
    boxes = np.column_stack([table[name] for name in "xywh"])
    np.testing.assert_array_equal(boxes[:2], truth[:2])
    assert np.abs(boxes - truth).max() < 5
    assert np.isnan(table["x_2.5"][:2]).all(), "nothing is estimated in the start frame"
    # An interval holds its estimate, and here almost always the truth.
    low, high = (np.column_stack([table[f"{n}_{end}"] for n in "xywh"]) for end in ("2.5", "97.5"))
    assert np.all((low <= boxes) & (boxes <= high), axis=1)[2:].all()
    assert np.mean((low <= truth) & (truth <= high), axis=0, where=~np.isnan(low)).min() > 0.7
    # Both move by sqrt(5) and sqrt(2) pixels a frame.
    for name, step in ((1, 5**0.5), (2, 2**0.5)):
        speed = table["speed"][2:][table["id"][2:] == name]
        assert np.median(speed) == pytest.approx(25 * step, rel=0.5)


def test_the_verdict_of_each_object_is_printed_and_kept(whole_run):
    outcome, output = whole_run
    objects, table = summary_of(output)["objects"], read_tracks(output / "tracks.csv")
    assert set(objects) == {"1", "2"}
    for name, about in objects.items():
        assert about["frames"] == LENGTH - 1
        assert about["tracked_until"] == LENGTH - 1
        assert about["lost"] == []
        rows = table["id"] == int(name)
        widths = (table[f"centre_{c}_97.5"][rows] - table[f"centre_{c}_2.5"][rows] for c in "xy")
        x, y = (float(f"{np.nanmedian(width):.2g}") for width in widths)
        (line,) = re.findall(f"Object {name}: .*", outcome.out)
        assert line.endswith(f": {x:g} pixels wide along x, {y:g} along y")
    assert summary_of(output)["effective_sample_size"] > 2
    assert "near 1" not in outcome.out


def test_the_confidence_is_the_same_in_tracks_diagnostics_and_summary(whole_run):
    _, output = whole_run
    confidence = rows_of(output)[2:, 6].reshape(-1, 2)
    assert np.all((confidence > 0) & (confidence < 1))
    table = np.loadtxt(output / "diagnostics.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 5:], confidence)
    mean = [summary_of(output)["objects"][name]["mean_confidence"] for name in ("1", "2")]
    np.testing.assert_allclose(mean, confidence.mean(axis=0), atol=1e-4)


def test_lost_means_the_same_in_tables_verdicts_and_exports(run_of, tmp_path):
    """Object 2 vanishes after frame 4."""
    outcome, output = run_of("film")
    table = read_tracks(output / "tracks.csv")
    lost = table["lost"] == 1
    assert lost[table["id"] == 2].any()
    np.testing.assert_array_equal(lost, table["confidence"] < LOST_BELOW)
    for name, about in summary_of(output)["objects"].items():
        said = [n for first, last in about["lost"] for n in range(first, last + 1)]
        assert table["frame"][lost & (table["id"] == int(name))].tolist() == said
        assert about["frames_lost"] == len(said)
        assert (f"lost in {len(said)} of {LENGTH - 1} frames" in outcome.out) or not said
    exported = jaxpf("export", output, "mot", tmp_path / "t.txt")
    assert exported.code == 0
    np.testing.assert_array_equal(read_boxes(tmp_path / "t.txt").confidence < LOST_BELOW, lost)


def test_times_speeds_and_overlay_are_those_of_the_film(run_of):
    _, output = run_of("film")
    table = read_tracks(output / "tracks.csv")
    times = np.array(STAMPS) / 1000
    np.testing.assert_allclose(table["time"][::2], times, atol=1e-3)
    places = table["x"] + table["w"] / 2, table["y"] + table["h"] / 2
    steps = np.hypot(*(np.diff(place.reshape(LENGTH, 2), axis=0) for place in places))
    # The first step is from the given box; speeds are of the particles' mean.
    speeds = table["speed"].reshape(LENGTH, 2)[1:]
    np.testing.assert_allclose(speeds[1:], (steps / np.diff(times)[:, None])[1:], rtol=0.1, atol=3)
    assert summary_of(output)["fps"] == pytest.approx(25)
    overlay = open_frames(output / "overlay.mp4")
    shown = [overlay.shown_at(number) for number, _ in enumerate(overlay)]
    np.testing.assert_allclose(shown, times, atol=1e-3)


def test_overlay_and_progress_are_of_every_frame(whole_run):
    outcome, output = whole_run
    overlay = open_frames(output / "overlay.mp4")
    assert [frame.shape for frame in overlay] == [(HEIGHT, WIDTH, 3)] * LENGTH
    assert overlay.fps == 25
    for words in ("9/9", "frames/s", "left"):
        assert words in outcome.err


def test_the_summary_holds_parameters_versions_seed_and_timing(whole_run):
    summary = summary_of(whole_run[1])
    assert summary["parameters"]["seed"] == 0
    assert summary["parameters"]["num_particles"] == 60
    assert summary["frames_tracked"] == LENGTH - 1
    assert (summary["interrupted"], summary["error"]) == (False, None)
    assert summary["mean_mc_error"] is None  # --runs ask for it
    for name in ("frames_outside", "frames_without_likelihood"):
        assert summary[name] == {"1": [], "2": []}
    assert summary["seconds_first_frame"] > 0
    assert summary["frames_per_second"] > 0
    assert {"python", "jax", "jaxlib", "numpy", "jaxpf"} <= set(summary["versions"])


def test_the_diagnostics_are_numbers_by_frame(whole_run):
    _, output = whole_run
    header, *rows = (output / "diagnostics.csv").read_text().splitlines()
    shares = "distinct_share_1,distinct_share_2"
    assert header == f"frame,ess,log_evidence,{shares},confidence_1,confidence_2"
    numbers = np.array([row.split(",") for row in rows], float)
    np.testing.assert_array_equal(numbers[:, 0], np.arange(1, LENGTH))
    assert np.all((numbers[:, 1] >= 1) & (numbers[:, 1] <= 60))
    assert np.all((numbers[:, 3:] > 0) & (numbers[:, 3:] <= 1))


def test_truth_adds_a_table_over_the_frames_that_have_truth(whole_run):
    outcome, output = whole_run
    assert "Against the truth" in outcome.out
    assert "object 2" in outcome.out
    header, *rows = (output / "metrics.csv").read_text().splitlines()
    assert header.startswith("id,frames,success_rate_50,success_auc,iou,tracked,precision")
    boxes = dense(read_boxes(output / "tracks.csv"), [1, 2], LENGTH)[1:]
    truth = np.array([true_boxes(number) for number in range(1, LENGTH)])
    ious = np.asarray(measures.iou(boxes, truth))
    for row, known in zip(rows, (ious[:, 0], ious[:-1, 1]), strict=True):
        values = dict(zip(header.split(","), map(float, row.split(",")), strict=True))
        assert (values["frames"], values["tracked"]) == (len(known), 1)
        assert values["success_rate_50"] == pytest.approx(np.mean(known > 0.5), rel=1e-5)
        thresholds = np.arange(21)[:, None] / 20
        assert values["success_auc"] == pytest.approx(np.mean(known > thresholds), rel=1e-5)
    table = outcome.out[outcome.out.index("Against the truth") :]
    assert table.index("success at IoU 0.5") < table.index("success AUC") < table.index("tracked")


def test_run_toml_repeats_the_run_bit_for_bit(whole_run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # the file does not depend on where one stands
    outcome = jaxpf("track", "--config", whole_run[1] / "run.toml", "-o", "again")
    assert outcome.code == 0, outcome.err
    for name in ("tracks.csv", "diagnostics.csv", "metrics.csv", "run.toml"):
        assert (tmp_path / "again" / name).read_bytes() == (whole_run[1] / name).read_bytes()


def test_run_toml_holds_every_option_that_shapes_the_result(whole_run):
    options = tomllib.loads((whole_run[1] / "run.toml").read_text())["track"]
    boxes = command.get_command(None, "boxes")
    every = options_of(*(one.build for one in all_filters().values()))
    of_others = every.keys() - options_of(filter_of("dps").build) | options_of(Rules).keys()
    # Video is tracked by learned appearance, relative motion and dps: others' options say nothing.
    unset = "bands likelihood noise_pixels swap noise_relative network boxes ids detections frames"
    unset += " fps range order ess_threshold tracker runs resume"
    elsewhere = "output overwrite config set save_state"
    names = {param.name for param in boxes.params} | {"target"}
    assert set(options) == names - of_others - {*unset.split(), *elsewhere.split()}


def test_pictures_of_16_bits_with_a_rate_of_their_own_give_the_tracks_of_the_video(
    whole_run, run_of, place
):
    _, output = run_of("deep")
    table, expected = (read_tracks(f / "tracks.csv") for f in (output, whole_run[1]))
    assert list(table) == list(expected)
    for name in table.keys() - {"time", "speed", "speed_2.5", "speed_97.5"}:
        np.testing.assert_array_equal(table[name], expected[name])
    np.testing.assert_allclose(table["time"], table["frame"] / 10)
    np.testing.assert_allclose(table["speed"], 0.4 * expected["speed"], atol=2e-3)
    assert summary_of(output)["fps"] == 10
    assert open_frames(output / "overlay.mp4").fps == 10
    assert tomllib.loads((output / "run.toml").read_text())["track"]["range"] == [100, 610]
    deep = open_frames(place / "deep", range=(100, 610))
    plain = open_frames(place / "images")
    np.testing.assert_array_equal(next(deep.frames()), next(plain.frames()))


def test_boxes_of_a_gt_file_a_mot_file_and_of_tracks_start_the_same_run(whole_run, place, tmp_path):
    mot = tmp_path / "start.txt"
    exported = jaxpf("export", whole_run[1], "mot", mot)
    assert exported.code == 0, exported.err
    start = started_by_track("boxes", place / "clip.avi", *BOXES)
    for boxes in (place / "gt.csv", mot, whole_run[1] / "tracks.csv"):
        given = ("--boxes", boxes, "--ids", "1,2")
        same = started_by_track("boxes", place / "clip.avi", *given)
        np.testing.assert_array_equal(same.ids, start.ids)
        np.testing.assert_array_equal(same.shapes, start.shapes)


def test_ids_and_frames_are_chosen_and_names_may_have_any_letters(place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(place / "clip.avi", tmp_path / "mein Vidéo:1 日本.avi")
    truth = write_truth(tmp_path / "named.csv", ids=(7, 3))
    chosen = ("--boxes", truth, "--ids", "3,7", "--start", 3, "--frames", 2)
    outcome = jaxpf("track", "mein Vidéo:1 日本.avi", *chosen, *PARTICLES)
    assert outcome.code == 0, outcome.err
    output = tmp_path / "jaxpf-mein Vidéo:1 日本"  # named after the video
    rows = rows_of(output)
    np.testing.assert_array_equal(rows[:, 0], [3, 3, 4, 4, 5, 5])
    np.testing.assert_array_equal(rows[:, 1], [3, 7, 3, 7, 3, 7])
    np.testing.assert_array_equal(rows[:2, 2:6], true_boxes(3)[::-1])
    assert len(list(open_frames(output / "overlay.mp4"))) == 3


def test_an_order_counts_from_1_and_every_object_may_have_a_noise_of_its_own(place):
    given = ("--method", "ps", "--set", "order=2,1", "--noise-relative", ".045,.18,.02,0,0,0")
    _, tracker = built_by_track("boxes", place / "clip.avi", *BOXES, *given)
    assert_same(tracker.ordering, ordering.ps([1, 0]))
    np.testing.assert_allclose(tracker.dynamics.steps, [[0.045, 0.18, 0.02], [0, 0, 0]])


def test_overwrite_leaves_no_file_of_the_earlier_run_and_every_other_file(
    whole_run, track, tmp_path
):
    output = shutil.copytree(whole_run[1], tmp_path / "out")
    (output / "notes.txt").touch()
    given = ("--frames", 1, "--seed", 1, "--no-overlay", "--overwrite")
    again = track(*BOXES, *given)
    assert again.code == 0, again.err
    left = {path.name for path in output.iterdir()}
    assert "notes.txt" in left
    assert not left & {"overlay.mp4", "metrics.csv"}
    first, other = (read_tracks(f / "tracks.csv")["x"][2:4] for f in (whole_run[1], output))
    assert (first != other).all(), "another seed gives other tracks"


@pytest.fixture(scope="module")
def begun(place, tmp_path_factory):
    """A run of four frames: its folder, its state, and states saved before: (rows, path)."""
    folder, copies, save = tmp_path_factory.mktemp("begun"), [], states.save

    def save_and_copy(path, state):
        save(path, state)
        rows = (folder / "out" / "tracks.csv").read_text().count("\n") - 1
        copies.append((rows, shutil.copy(path, folder / f"{len(copies)}.npz")))

    kept = folder / "kept.npz"
    kept.touch()
    given = (*BOXES, *PARTICLES, "--frames", 4, "--no-overlay", "--save-state", kept)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(results, "_SAVE_EVERY", -1)
        patch.setattr(states, "save", save_and_copy)
        outcome = jaxpf("track", place / "clip.avi", *given, "--overwrite", "-o", folder / "out")
    assert outcome.code == 0, outcome.err
    return folder / "out", kept, copies


def test_a_run_in_two_pieces_gives_the_tracks_of_one(whole_run, track, tmp_path, begun):
    before, state, _ = begun
    kept = shutil.copy(state, tmp_path)
    # A state replaces the one that it goes on from.
    second = track(*BOXES, "--resume", kept, "--save-state", kept)
    assert second.code == 0, second.err
    header, rows = (tmp_path / "out" / "tracks.csv").read_text().split("\n", 1)
    tracks = (before / "tracks.csv").read_text()
    assert tracks.startswith(header)
    assert tracks + rows == (whole_run[1] / "tracks.csv").read_text()
    assert summary_of(tmp_path / "out")["frames_tracked"] == LENGTH - 5


def test_a_state_saved_on_the_way_goes_on_bit_for_bit(whole_run, track, tmp_path, begun):
    """As after kill -9: of all that the run saves, only a state from its middle is there."""
    *_, copies = begun
    # After every frame, whose rows were written before; and at the end.
    assert [rows for rows, _ in copies] == [4, 6, 8, 10, 10]
    rows, middle = copies[1]
    outcome = track(*BOXES, "--resume", middle, "--no-overlay")
    assert outcome.code == 0, outcome.err
    _, *found = (tmp_path / "out" / "tracks.csv").read_text().splitlines()
    _, *expected = (whole_run[1] / "tracks.csv").read_text().splitlines()
    assert found == expected[rows:]


def test_states_of_other_runs_and_of_other_users_are_refused(refuse, begun):
    _, kept, _ = begun
    content = kept.read_bytes()
    assert "--save-state" in refuse(*BOXES, "--save-state", kept)
    assert "4 frames" in refuse(*BOXES, "--resume", kept, "--frames", 4)
    assert "particles" in refuse(*BOXES, "--resume", kept, "-n", 61)
    assert kept.read_bytes() == content


# By how much another run would differ


@pytest.mark.slow
def test_runs_side_by_side_tell_how_much_they_differ(track, tmp_path):
    outcome = track(*BOXES, "--runs", 8, "--frames", 4)
    assert outcome.code == 0, outcome.err
    table = read_tracks(tmp_path / "out" / "tracks.csv")
    for name in ("x", "y"):
        error = table[f"{name}_mc_error"][2:]
        assert np.all(error > 0)
        assert np.all(error < table[f"{name}_97.5"][2:] - table[f"{name}_2.5"][2:])
    assert (tmp_path / "out" / "overlay.mp4").exists()
    for name, error in summary_of(tmp_path / "out")["mean_mc_error"].items():
        rows = table["id"] == int(name)
        errors = np.stack([table["x_mc_error"][rows], table["y_mc_error"][rows]])
        np.testing.assert_allclose(error, np.nanmean(errors), atol=1e-3)
        assert f"{name} {error:.2g}" in outcome.out
