"""A tracker from start contours: it follows its targets, keeps them apart, and writes tracks."""

import dataclasses
from itertools import permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from csv_rows import rows_of
from refusals import message_of

import jaxpf
import scenes
from jaxpf.contours import Contours
from jaxpf.contours.target import CONTOURS, OutlineFile, _hidden
from jaxpf.shapes.splines import fit_spline
from jaxpf.targets import Start


@jax.jit
def log_odds(likelihood, frame, places):
    """Log odds of both wires at their places ``[2, D]``."""
    return likelihood.log_odds_all(likelihood.observe(frame), jnp.arange(2), places.T)


def start_contours(scene, closed, names=("left", "right"), **about):
    points = [fit_spline(line, 8, closed=closed) for line in scene.extras["outlines"][0]]
    return Contours(names, np.array(points), closed=closed, **about)


@pytest.fixture(scope="module")
def wires():
    scene = scenes.make("wires", seed=1, num_frames=12, meeting_frames=2, meeting_distance=60)
    return scene, start_contours(scene, False, width=4.0)


@pytest.fixture(scope="module")
def tracked(wires):
    scene, start = wires
    tracker = jaxpf.contours.tracker(
        scene.frames[0], start, sigma=3.0, independence=1.0, num_particles=150
    )
    _, summary = jaxpf.run(tracker, jax.random.key(0), jnp.asarray(scene.frames[1:]))
    return tracker, np.asarray(summary.estimate)


@pytest.mark.slow
def test_both_wires_are_followed(wires, tracked):
    found, truth = jaxpf.contours.to_contours(*tracked)[-1], wires[0].extras["outlines"][-1]
    gaps = np.linalg.norm(found[:, :, None] - truth[:, None], axis=-1).min(axis=-1).mean(axis=-1)
    assert (gaps < 5).all()


@pytest.mark.slow
def test_confidence_falls_where_the_wires_vanish(wires, tracked):
    scene, _ = wires
    gone = np.array(scene.frames[1:])
    gone[6:] = np.median(gone)
    _, summary = jaxpf.run(tracked[0], jax.random.key(0), jnp.asarray(gone))
    assert (summary.confidence[:6] > 0.8).all()
    assert (summary.confidence[-1] < 0.1).all()


def test_confidence_counts_edges_beside_those_at_the_start(wires):
    """Of edges so weak that only a part of them shows, a start frame makes those enough."""
    scene, start = wires
    frame = np.asarray(scene.frames[0], float)
    grain = np.random.default_rng(0).normal(0, 0.7, frame.shape)  # without it, edges tie
    faint = np.median(frame) + 0.15 * (frame - np.median(frame)) + grain
    faint = np.round(faint).astype(np.uint8)
    made = jaxpf.contours.tracker(faint, start, clutter=0.5, edge_threshold=4.0).likelihood
    shown = np.asarray(made.at_start)
    assert (shown < 0.9).all()
    place = np.asarray(made.space.project(start.points))
    all_shown = dataclasses.replace(made, at_start=jnp.full(2, 0.8))
    for likelihood, expected in ((made, 3.0), (all_shown, 30 * (shown / 0.8 - 0.9))):
        np.testing.assert_allclose(log_odds(likelihood, faint, place), expected, rtol=1e-3)


def test_edges_outside_the_frame_are_not_counted(wires):
    """Of a contour that leaves the frame only what is inside says where it is."""
    scene, start = wires
    likelihood = jaxpf.contours.tracker(scene.frames[0], start, clutter=0.5).likelihood
    place = np.asarray(likelihood.space.project(start.points))
    away = place + np.array([5000.0, 0, 0, 0], np.float32)
    assert (log_odds(likelihood, scene.frames[0], away) < -20).all()
    half = np.asarray(scene.frames[0])[: int(np.mean(start.points[..., 1]))]
    assert (log_odds(likelihood, half, place) > 1).all()
    assert (log_odds(likelihood, np.full_like(half, np.median(half)), place) < -20).all()


def test_filmed_contours_slip_and_move_by_shares_of_their_size(wires):
    scene, start = wires
    sizes = np.linalg.norm(np.ptp(start.points, axis=1), axis=-1) / np.sqrt(2)
    made = jaxpf.contours.tracker(scene.frames[0], start, clutter=0.5)
    slip = 0.1 * sizes[:, None] * [1, 1, 0]
    np.testing.assert_allclose(made.likelihood.model_error, slip, rtol=1e-6)
    np.testing.assert_allclose(
        made.dynamics.scale, sizes[:, None] * [0.05, 0.05, 0.006, 0.006], rtol=1e-6
    )
    asked = jaxpf.contours.tracker(scene.frames[0], start, clutter=0.5, slip=0, noise_shift=2)
    np.testing.assert_allclose(asked.likelihood.model_error, 0)
    np.testing.assert_allclose(asked.dynamics.scale[:, :2], 2)
    np.testing.assert_allclose(asked.dynamics.scale[:, 2:], made.dynamics.scale[:, 2:])


@pytest.mark.slow
@pytest.mark.always
def test_tracks_hold_control_points_and_outlines(tmp_path, wires, tracked):
    tracker, estimates = tracked
    space = tracker.likelihood.space
    broken = estimates[1].copy()
    broken[1] = np.nan
    with OutlineFile(tmp_path / "tracks.csv", CONTOURS.start(wires[1])) as write:
        for frame, estimate in enumerate((estimates[0], broken)):
            write(frame, CONTOURS.shapes(None, estimate, tracker))
    rows = rows_of(tmp_path / "tracks.csv")
    assert len(rows) == 3 * (8 + 65)
    wanted = ("0", "control", "right")
    found = [
        (float(row["x"]), float(row["y"]))
        for row in rows
        if (row["frame"], row["kind"], row["id"]) == wanted
    ]
    np.testing.assert_allclose(found, space.control_points(estimates[0])[1], atol=1e-3)


def test_opaque_targets_are_branched_and_labelled(wires):
    scene, start = wires
    closed = Contours(start.names, start.points)
    opaque = {"exclusion": "opaque", "clutter": 0.5}
    made = jaxpf.contours.tracker(scene.frames[0], closed, **opaque)
    assert made.ordering.keeps_components
    np.testing.assert_array_equal(made.initial_label, (0.5, 0.5))
    np.testing.assert_allclose(made.initial, 0, atol=1e-3)
    plain = jaxpf.contours.tracker(scene.frames[0], closed, **opaque, method="sir")
    assert not plain.ordering.keeps_components


@pytest.mark.parametrize("count", [3, pytest.param(4, marks=pytest.mark.slow)])
def test_each_order_in_depth_has_a_label_and_a_branch(count):
    scene = scenes.make("leaves", seed=0, leaves=count, num_frames=2)
    start = start_contours(scene, True, tuple(range(count)))
    made = jaxpf.contours.tracker(scene.frames[0], start, exclusion="opaque", clutter=0.5)
    orders = list(permutations(range(count)))
    np.testing.assert_allclose(made.initial_label, 1 / len(orders))
    assert made.ordering.keeps_components
    np.testing.assert_array_equal(made.ordering.order, orders)


def test_what_particles_believe_to_be_hidden_is_drawn_so():
    turn = np.linspace(0, 2 * np.pi, 65)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    lines = 20 * circle + np.array([(50, 50), (65, 50), (80, 50)])[:, None]
    first, last = _hidden(np.stack([lines, lines]), [(0, 1, 2), (2, 1, 0)])
    assert not first[0].any()
    assert not last[2].any()
    x = lines[..., 0]
    np.testing.assert_array_equal(first[1], x[1] < 57.5)
    np.testing.assert_array_equal(last[1], x[1] > 72.5)
    # The third is hidden by both of the others: what lies in either.
    in_first, in_second = (np.linalg.norm(lines[2] - (x, 50), axis=-1) < 20 for x in (50, 65))
    np.testing.assert_array_equal(first[2], in_first | in_second)


@pytest.mark.parametrize(
    ("options", "named"),
    [({"exclusion": "opaque"}, "open contours"), ({"noise_bend": -1.0}, "noise_bend")],
)
def test_what_cannot_be_tracked_is_refused(wires, options, named):
    scene, start = wires
    given = {"clutter": 0.5, **options}
    assert named in message_of(jaxpf.contours.tracker, scene.frames[0], start, **given)


def test_scenes_tell_where_contours_start_and_shapes_are_written(tmp_path, wires):
    scene, contours = wires
    start, truth = CONTOURS.scene_start(scene), CONTOURS.scene_shapes(scene)
    assert start.contours.width == scene.parameters["wire_width"]
    tracker = jaxpf.contours.tracker(scene.frames[0], contours, clutter=0.5)
    found = CONTOURS.shapes(start, tracker.likelihood.space.project(contours.points), tracker)
    measured = CONTOURS.measures(found, truth[0], start.sizes)
    assert np.asarray(measured["iou"]).min() > 0.5
    assert np.asarray(measured["corner_error"]).max() < 5
    # A stored evaluation knows of shapes, and of no splines.
    stored = Start(start.ids, start.shapes, start.sizes, start.parents)
    with CONTOURS.outline_file(tmp_path / "tracks.csv", stored) as write:
        write(3, np.asarray(found))
    rows = rows_of(tmp_path / "tracks.csv")
    assert {(row["id"], row["kind"]) for row in rows} == {("1", "outline"), ("2", "outline")}


def test_a_closed_contour_ends_where_it_begins():
    scene = scenes.make("leaves", seed=0, num_frames=2)
    shapes = CONTOURS.scene_shapes(scene)
    np.testing.assert_array_equal(shapes[..., :2], shapes[..., -2:])
    start = CONTOURS.scene_start(scene)
    np.testing.assert_array_equal(start.shapes[:, :2], start.shapes[:, -2:])
    assert (
        np.asarray(CONTOURS.measures(start.shapes, shapes[0], start.sizes)["corner_error"]).max()
        < 1
    )
    given = {"exclusion": "opaque", "clutter": 1.0, "num_particles": 9}
    tracker = jaxpf.contours.tracker(scene.frames[0], start, **given)
    assert tracker.ordering.keeps_components
    assert tracker.initial_label is not None
