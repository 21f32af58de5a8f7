"""One call per system: ``like`` builds the trackers that repeat the papers."""

import functools
import operator
from pathlib import Path

import jax
import numpy as np
import pytest
from clips import write_pictures
from command_line import assert_same, built_by_track

import jaxpf
import scenes
from jaxpf import InputError, ordering
from jaxpf.dynamics.relative import RelativeMotion
from jaxpf.papers.eskil2014 import scenes as eskil2014
from jaxpf.papers.gonzales2011 import scenes as gonzales2011
from jaxpf.papers.maccormick1999 import scenes as cases, study as passing

FRAME = np.random.default_rng(0).integers(0, 255, (90, 120, 3), np.uint8)
BOXES = np.array([[20.0, 20, 16, 20], [60, 30, 16, 20], [90, 50, 16, 20]])
POSES = np.array([[60.0, 45, 0], [60, 65, 0], [75, 45, 0]])
PARTS = jaxpf.parts.Parts(("body", "leg", "arm"), (-1, 0, 0), POSES, np.full((3, 2), 14.0))
TURN = np.linspace(0, 2 * np.pi, 8, endpoint=False)
RING = 15 * np.stack([np.cos(TURN), np.sin(TURN)], axis=-1) + np.array([[[40.0, 45]], [[80, 45]]])


def contours(closed):
    return jaxpf.contours.Contours(("a", "b"), RING, closed, width=None if closed else 4.0)


@functools.cache
def preset(name, **changed):
    """The tracker of a preset, on noise."""
    like, _, kind = name.partition(", ")
    make, given = {
        "smith2004": (jaxpf.boxes.tracker, BOXES),
        "rowe2005": (jaxpf.boxes.tracker, BOXES),
        "gonzales2011": (jaxpf.parts.tracker, PARTS),
        "eskil2014": (jaxpf.points.tracker, BOXES[:, :2] + 10),
        "pffl": (jaxpf.points.tracker, BOXES[:, :2] + 10),
        "maccormick1999": (jaxpf.contours.tracker, contours(kind == "opaque")),
    }[like]
    return make(FRAME, given, like=like, **changed)


BOUNDARIES = [[1, 0, 0], [0.1, 0.9, 0], [0.05, 0.2, 0.75]]  # maccormick1999, section 2
#: Name -> (attribute, published value).  Where the papers give no value, that of the judged rows.
PUBLISHED = {
    "smith2004": [  # section 4.1, and table 1
        ("num_particles", 300),
        ("likelihood.sharpness", 20),
        ("dynamics.scale", (2, 2, 0.001)),
        ("dynamics.momentum", 0.5),
        ("likelihood.method", "integral"),  # of all pixels, as judged
        ("likelihood.references.shape", (3, 2, 112)),  # two halves; 110 bins, padded
        ("resampling.name", "multinomial"),
    ],
    "rowe2005": [  # section 4, eq. 3, 4 and 6
        ("num_particles", 100),
        ("likelihood.pool", "mean"),
        ("weights", "equal_share"),
        ("feedback", "estimate"),
        ("resampling.name", "multinomial"),
    ],
    "gonzales2011": [  # section 4
        ("likelihood.likelihood.sharpness", 50),
        ("resampling.name", "multinomial"),  # indices are selected independently, section 3.1
        ("initial.reach", [[5, 5, 0.1]] * 3),  # uniform around the object, in a range of our own
        ("initial.poses", POSES),
    ],
    "eskil2014": [  # table 2
        ("num_particles", 10),
        ("likelihood.references.shape", (3, 21, 21 * 3)),
        ("likelihood.sigma", 0.1),
        ("dynamics.scale", 5),  # of two of three films
        ("dynamics.momentum", 0),  # step 1 of section 3.4
        ("likelihood.norm", "sum"),
        ("shape_scale", 0.01),
        ("shape", "pixels"),
        ("drift", "literal"),
    ],
    "pffl": [  # the same table
        ("num_particles", 50),
        ("likelihood.references.shape", (3, 21, 21 * 3)),
        ("likelihood.sigma", 0.1),
        ("dynamics.scale", 5),
        ("dynamics.momentum", 0),
        ("likelihood.norm", "sum"),
        ("form", "literal"),
    ],
    "maccormick1999, wires": [  # sections 2 and 3
        ("likelihood.sigma", 7),
        ("likelihood.detection", BOUNDARIES),
        ("likelihood.independence", 1),
        ("likelihood.reward", "literal"),
        ("resampling.name", "multinomial"),  # with replacement
        ("num_particles", 300),  # not printed, as judged
        ("ordering.resample_after", [False, False]),
    ],
    "maccormick1999, opaque": [  # sections 4 and 5
        ("likelihood.sigma", 7),
        ("likelihood.detection", BOUNDARIES),
        ("likelihood.independence", 1),
        ("likelihood.reward", "literal"),
        ("resampling.name", "multinomial"),
        ("num_particles", 750),
        ("dynamics.flip", 0.01),
        ("ordering.order", [[0, 1], [1, 0]]),  # who is in front comes first
        ("initial.shape", (2, 6)),  # affine
    ],
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_setting_of_a_preset_is_the_published_one(name):
    tracker = preset(name)
    for attribute, published in PUBLISHED[name]:
        found = operator.attrgetter(attribute)(tracker)
        if published is None or isinstance(published, str):
            assert found == published, attribute
            continue
        found = found[:3, :3] if published is BOUNDARIES else found
        np.testing.assert_allclose(found, published, rtol=1e-6, err_msg=attribute)


def test_smith2004_and_gonzales2011_have_the_papers_orderings():
    dps = ordering.dps(3, reassembly="literal")
    assert_same(preset("smith2004").ordering, dps)
    tracker = preset("gonzales2011")
    assert_same(tracker.ordering, ordering.named("sps", (-1, 0, 0), swap="sorted"))
    assert isinstance(tracker.dynamics, jaxpf.dynamics.RandomWalk), "no part follows another"


@pytest.mark.parametrize("dynamics", ["absolute", "relative"])
def test_particles_of_gonzales2011_start_uniformly_around_the_object(dynamics):
    tracker = preset("gonzales2011", dynamics=dynamics)
    root = np.asarray(tracker.init(jax.random.key(0)).substates)[:, 0, :3] - POSES[0]
    assert (np.abs(root) <= (5, 5, 0.1 + 1e-6)).all()
    # The standard deviation of 300 uniform numbers has a relative standard error of .026.
    np.testing.assert_allclose(root.std(axis=0), np.array([5, 5, 0.1]) / 3**0.5, rtol=0.12)
    exact = jaxpf.parts.tracker(FRAME, PARTS, dynamics=dynamics)
    assert np.ptp(np.asarray(exact.init(jax.random.key(0)).substates), axis=0).max() == 0


@pytest.mark.parametrize(
    ("row", "like"), [("eskil2014 as printed", "eskil2014"), ("PFFL as printed", "pffl")]
)
def test_rows_of_eskil2014_as_printed_are_the_presets(row, like):
    assert_same(eskil2014.tracker_of(row, FRAME, BOXES[:, :2] + 10, scale=5.0), preset(like))


def test_rows_of_gonzales2011_start_and_exchange_as_the_preset_does():
    scene = scenes.make("articulated", 0, num_parts=3, num_frames=2)
    grid = gonzales2011.grid(scene, "smooth", 300)
    row, column = gonzales2011.VARIANTS["SPS sorted, absolute"]
    swapped = jax.tree.map(operator.itemgetter(row), grid.rows)
    absolute = jax.tree.map(operator.itemgetter(column), grid.columns)
    judged, ours = grid.build(swapped, absolute), preset("gonzales2011")
    assert_same(judged.ordering, ours.ordering)
    np.testing.assert_array_equal(judged.initial.reach, ours.initial.reach)
    assert (judged.resampling.name, judged.num_particles) == (ours.resampling.name, 300)
    assert judged.likelihood.likelihood.sharpness == ours.likelihood.likelihood.sharpness


@pytest.mark.parametrize(
    ("kind", "case", "method"),
    [
        ("wires", cases.wires, passing.WIRES["P, exclusion, all as printed"]),
        ("opaque", cases.leaves, passing.LEAVES["PS, 750, all as printed"]),
    ],
)
def test_rows_of_maccormick1999_as_printed_are_the_presets(kind, case, method):
    judged = cases.tracker_of(case(0, num_frames=9), method)
    ours = preset(f"maccormick1999, {kind}")
    for attribute, _ in PUBLISHED[f"maccormick1999, {kind}"]:
        found, expected = (operator.attrgetter(attribute)(each) for each in (judged, ours))
        np.testing.assert_array_equal(found, expected, err_msg=attribute)


def test_rowe2005_tracks_boxes_of_any_shape():
    tracker = preset("rowe2005", num_particles=9)
    assert (type(tracker), tracker.num_particles) == (jaxpf.Labelled, 9)
    np.testing.assert_allclose(jaxpf.boxes.to_boxes(tracker, tracker.initial), BOXES)
    with pytest.raises(InputError, match="has a method and likelihood of its own"):
        preset("rowe2005", method="ps")


def test_the_command_line_takes_the_function_that_the_page_shows(tmp_path):
    """``tests/house`` runs trackers of users."""
    page = (Path(__file__).parents[2] / "notebooks" / "docs" / "papers.md").read_text()
    (tmp_path / "systems.py").write_text(page.split("```python\n")[1].split("```")[0])
    clip = write_pictures(tmp_path / "clip", [FRAME] * 2)
    boxes = [f"--box={','.join(map(str, box))}" for box in BOXES]
    own = "--tracker", f"{tmp_path / 'systems.py'}:rowe2005"
    _, tracker = built_by_track("boxes", clip, *boxes, *own)
    assert (type(tracker), tracker.weights) == (jaxpf.Labelled, "equal_share")
    np.testing.assert_allclose(jaxpf.boxes.to_boxes(tracker, tracker.initial), BOXES)


def test_other_arguments_override_a_preset_with_what_hangs_on_them():
    few = preset("smith2004", num_particles=6)
    assert (few.num_particles, few.likelihood.method) == (6, "integral")
    in_order = preset("smith2004", method="ps")
    assert not np.ptp(in_order.ordering.order, axis=0).any()
    assert in_order.resampling.name == "multinomial"
    assert isinstance(preset("smith2004", motion="relative").dynamics, RelativeMotion)
    of_points = preset("eskil2014", method="sps")
    assert (type(of_points), of_points.likelihood.norm) == (jaxpf.Partitioned, "sum")
    free = preset("eskil2014", shape="none")
    assert (free.drift, free.shape) == ("literal", "none")


@pytest.mark.slow
def test_another_appearance_has_nothing_of_a_presets_own():
    assert not hasattr(preset("smith2004", appearance="discriminative").likelihood, "method")
