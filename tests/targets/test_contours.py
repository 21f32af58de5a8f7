"""A tracker from start contours: it follows its targets, keeps them apart, and writes tracks."""

import csv

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
import scenes
from jaxpf.errors import InputError
from jaxpf.files.contours import Contours, ContourTrackWriter
from jaxpf.filters.partitioned.options import PARTITIONED
from jaxpf.filters.partitioned.options import Options as FilterOptions
from jaxpf.models.likelihoods.contours import EdgeDetector
from jaxpf.models.splines import fit_spline
from jaxpf.targets.contour_tracking import contours_tracker, outlines
from jaxpf.targets.contours import CONTOURS, Options
from jaxpf.targets.target import Looks, Start


@pytest.fixture(scope="module")
def wires():
    scene = scenes.make("wires", seed=1, num_frames=12, meeting_frames=2, meeting_distance=60)
    points = [fit_spline(line, 8, closed=False) for line in scene.extras["outlines"][0]]
    start = Contours(("left", "right"), np.array(points), closed=False, width=4.0)
    return scene, start


@pytest.fixture(scope="module")
def tracked(wires):
    scene, start = wires
    tracker = contours_tracker(
        start, scene.frames, detector=EdgeDetector(smoothing=1.0), sigma=3.0, num_particles=150
    )
    _, summary = jaxpf.run(tracker, jax.random.key(0), jnp.asarray(scene.frames[1:]))
    return tracker, np.asarray(summary.estimate)


def test_both_wires_are_followed(wires, tracked):
    found, truth = outlines(*tracked)[-1], wires[0].extras["outlines"][-1]
    gaps = np.linalg.norm(found[:, :, None] - truth[:, None], axis=-1).min(axis=-1).mean(axis=-1)
    assert (gaps < 5).all()


def test_tracks_hold_control_points_and_outlines(tmp_path, tracked):
    tracker, estimates = tracked
    broken = estimates[1].copy()
    broken[1] = np.nan
    space = tracker.likelihood.space
    with ContourTrackWriter(tmp_path / "tracks.csv") as writer:
        for frame, estimate in enumerate((estimates[0], broken)):
            control = np.asarray(space.control_points(estimate))
            writer.append(frame, ("left", "right"), control, outlines(tracker, estimate))
    rows = list(csv.DictReader((tmp_path / "tracks.csv").open()))
    assert len(rows) == 3 * (8 + 32)
    control = [
        row
        for row in rows
        if (row["frame"], row["kind"], row["contour"]) == ("0", "control", "right")
    ]
    expected = tracker.likelihood.space.control_points(estimates[0])[1]
    np.testing.assert_allclose(
        [(float(row["x"]), float(row["y"])) for row in control], expected, atol=1e-3
    )


def test_opaque_targets_are_branched_and_labelled(wires):
    scene, start = wires
    closed = Contours(start.names, start.points)
    made = contours_tracker(closed, scene.frames, exclusion="opaque", clutter=0.5)
    assert made.ordering.keeps_components
    np.testing.assert_array_equal(made.initial_label, (0.5, 0.5))
    np.testing.assert_allclose(made.initial, 0, atol=1e-3)
    plain = contours_tracker(closed, scene.frames, exclusion="opaque", clutter=0.5, method="sir")
    assert not plain.ordering.keeps_components


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "dps"}, "method 'dps'"),
        ({"exclusion": "some"}, "exclusion 'some'"),
        ({"scale": (1.0, -1.0)}, "scale"),
        ({"scale": (1.0,) * 5}, "each of the 4 coordinates"),
        ({"space": "bent"}, "shape space 'bent'"),
        ({"exclusion": "opaque"}, "open contours"),
    ],
)
def test_what_cannot_be_tracked_is_refused(wires, options, message):
    with pytest.raises(InputError, match=message):
        contours_tracker(wires[1], wires[0].frames, **{"clutter": 0.5, **options})


def test_scenes_tell_where_contours_start_and_how_well_they_are_found(tmp_path, wires, tracked):
    scene, _ = wires
    start, truth = CONTOURS.scene_start(scene), CONTOURS.scene_shapes(scene)
    assert start.contours.width == scene.parameters["wire_width"]
    found = CONTOURS.shapes_of(tracked[0], start, tracked[1])
    measured = CONTOURS.measures(start, found, truth[1:])
    assert np.asarray(measured["overlap"])[-1].min() > 0.5
    assert np.asarray(measured["corner_error"])[-1].max() < 5
    # A stored evaluation knows of shapes, and of no splines.
    stored = Start(start.ids, start.shapes, start.sizes, start.parents)
    with CONTOURS.track_writer(tmp_path / "tracks.csv", stored) as writer:
        writer.append(3, found[0], None)
    rows = list(csv.DictReader((tmp_path / "tracks.csv").open()))
    assert {(row["contour"], row["kind"]) for row in rows} == {("1", "outline"), ("2", "outline")}
    _, doubled = CONTOURS.scaled(stored, found, (2.0, 1.0))
    wide, plain = (np.asarray(CONTOURS.outlines(stored, shapes)) for shapes in (doubled, found))
    np.testing.assert_allclose(wide, plain * (2, 1))


def test_a_closed_contour_ends_where_it_begins():
    scene = scenes.make("leaves", seed=0, num_frames=2)
    shapes = CONTOURS.scene_shapes(scene)
    np.testing.assert_array_equal(shapes[..., :2], shapes[..., -2:])
    start = CONTOURS.scene_start(scene)
    np.testing.assert_array_equal(start.shapes[:, :2], start.shapes[:, -2:])
    assert np.asarray(CONTOURS.measures(start, start.shapes, shapes[0])["corner_error"]).max() < 1
    model = CONTOURS.model(
        Options(exclusion="opaque", clutter=1.0), start, Looks(None, None, (9, 9), 9)
    )
    tracker = PARTITIONED.tracker(model, FilterOptions(method="ps", particles=9))
    assert tracker.ordering.keeps_components
    assert tracker.initial_label is not None
