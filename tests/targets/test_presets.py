"""One call per system: ``like`` builds the trackers that repeat the papers."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from command_line import assert_same, jaxpf as command

import jaxpf
import scenes
from jaxpf import InputError, ordering
from jaxpf.papers.smith2004.scenes import scene_tracker

FRAME = np.random.default_rng(0).integers(0, 255, (90, 120, 3), np.uint8)
BOXES = np.array([[20.0, 20, 16, 20], [60, 30, 16, 20], [90, 50, 16, 20]])


def test_smith2004_is_dps_with_the_papers_reassembly():
    patches = [scenes.cut_patch(FRAME, box) for box in BOXES]
    scene = scenes.Scene("boxes", FRAME[None], BOXES[None], patches, 25.0, {})
    ours = jaxpf.boxes.tracker(FRAME, BOXES, like="smith2004", patches=patches)
    assert_same(ours, scene_tracker(scene, ordering.dps(3, reassembly="literal")))
    assert jaxpf.boxes.tracker(FRAME, BOXES, like="smith2004", num_particles=60).num_particles == 60


def test_another_method_replaces_the_papers():
    ours = jaxpf.boxes.tracker(FRAME, BOXES, like="smith2004", method="ps")
    plain = jaxpf.boxes.tracker(
        FRAME, BOXES, method="ps", appearance="colour", resampling="multinomial",
        noise_pixels=(2, 2, 0.001),
    )  # fmt: skip
    assert_same(ours, plain)


def test_rowe2005_tracks_boxes_of_any_shape():
    tracker = jaxpf.boxes.tracker(FRAME, BOXES, like="rowe2005", num_particles=9)
    assert isinstance(tracker, jaxpf.Labelled)
    assert (tracker.weights, tracker.feedback) == ("equal_share", "estimate")
    assert (tracker.likelihood.pool, tracker.num_particles) == ("mean", 9)
    np.testing.assert_allclose(jaxpf.boxes.to_boxes(tracker, tracker.initial), BOXES)
    with pytest.raises(InputError, match="has a method and likelihood of its own"):
        jaxpf.boxes.tracker(FRAME, BOXES, like="rowe2005", method="ps")
    with pytest.raises(InputError, match="no field 'sharpnes'"):
        jaxpf.boxes.tracker(FRAME, BOXES, like="rowe2005", sharpnes=1)


def test_the_command_line_takes_the_function_that_the_page_shows(tmp_path):
    page = (Path(__file__).parents[2] / "notebooks" / "docs" / "papers.md").read_text()
    (tmp_path / "systems.py").write_text(page.split("```python\n")[1].split("```")[0])
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.roll(FRAME, number, axis=1))
    boxes = [f"--box={','.join(map(str, box))}" for box in BOXES]
    tracker = "--tracker", f"{tmp_path / 'systems.py'}:rowe2005"
    outcome = command("track", "boxes", tmp_path, *boxes, *tracker, "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert len((tmp_path / "out" / "tracks.csv").read_text().splitlines()) == 1 + 3 * len(BOXES)


def test_gonzales2011_is_sps_with_the_papers_swap():
    poses = np.array([[60.0, 45, 0], [60, 65, 0], [75, 45, 0]])
    parts = jaxpf.parts.Parts(("body", "leg", "arm"), (-1, 0, 0), poses, np.full((3, 2), 14.0))
    tracker = jaxpf.parts.tracker(FRAME, parts, like="gonzales2011")
    expected = ordering.named("sps", (-1, 0, 0), swap="sorted")
    assert_same(tracker.ordering, expected)
    assert isinstance(tracker.dynamics, jaxpf.dynamics.RandomWalk), "no part follows another"
    assert tracker.resampling.name == "multinomial"


def test_eskil2014_is_the_printed_equations():
    points = BOXES[:, :2] + 10
    tracker = jaxpf.points.tracker(FRAME, points, like="eskil2014", noise_points=4)
    assert (tracker.drift, tracker.shape) == ("literal", "pixels")
    assert tracker.shape_scale == pytest.approx(0.01)
    kept = jaxpf.points.tracker(FRAME, points, like="eskil2014", shape="none")
    assert (kept.drift, kept.shape) == ("literal", "none")


@pytest.mark.parametrize(("closed", "rule"), [(True, "opaque-literal"), (False, "wires-literal")])
def test_maccormick1999_has_the_printed_products(closed, rule):
    turn = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = 15 * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    contours = jaxpf.contours.Contours(
        ("a", "b"), ring + np.array([[[40.0, 45]], [[80, 45]]]), closed
    )
    tracker = jaxpf.contours.tracker(FRAME, contours, like="maccormick1999")
    plain = {"independence": 1, "sigma": 7, "exclusion": rule}
    if closed:
        plain |= {"flip": 0.01, "num_particles": 750, "method": "ps"}
    else:
        plain |= {"method": "sir"}
    assert_same(tracker, jaxpf.contours.tracker(FRAME, contours, **plain))
    assert tracker.likelihood.payment == "literal"


def test_an_unknown_system_is_refused():
    with pytest.raises(
        InputError, match="is not a published system of boxes; choose from smith2004"
    ):
        jaxpf.boxes.tracker(FRAME, BOXES, like="kalman1960")
