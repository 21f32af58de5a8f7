"""Points followed by every filter, from the same start."""

import dataclasses

import jax
import numpy as np
import pytest
from clips import write_pictures
from columns_of_tracks import columns_of
from histograms import texture
from refusals import message_of

import jaxpf
import scenes
from jaxpf.contract.options import defaults_of
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.trackers import tracker_of
from jaxpf.points import draw_points
from jaxpf.points.target import POINTS
from jaxpf.targets import Looks, Marks, Start
from jaxpf.targets.building import build, looks_of_scene
from jaxpf.tuning.sequences import with_tuned

RNG = np.random.default_rng(0)
PICTURE = texture(0, 120, 156, 6)
PLACES = np.array([[40.5, 40.5], [70.5, 45.5], [55.5, 75.5]])
FRAMES = np.stack([np.roll(PICTURE, 2 * t, axis=1) for t in range(1, 9)])


@pytest.mark.parametrize(
    "method", ["ps", "sps", *(pytest.param(n, marks=pytest.mark.slow) for n in ("eskil", "pffl"))]
)
def test_every_filter_follows_points_and_doubts_one_that_disappears(method):
    published = {"sigma": 0.1, "window_size": 21} if method == "eskil" else {}
    tracker = jaxpf.points.tracker(PICTURE, PLACES, method=method, noise_points=3.0, **published)
    frames = FRAMES.copy()
    for t in range(3, 8):  # noise hides the third point and what is around it
        x, y = (PLACES[2] + [2 * t + 2, 0]).astype(int)
        hidden = RNG.integers(0, 256, frames[t, y - 20 : y + 20, x - 20 : x + 20].shape)
        frames[t, y - 20 : y + 20, x - 20 : x + 20] = hidden
    state, summary = jaxpf.run(tracker, jax.random.key(0), frames)
    truth = PLACES + np.arange(2, 18, 2)[:, None, None] * np.array([1.0, 0.0])
    apart = np.linalg.norm(summary.estimate - truth, axis=-1)
    assert apart[:3].mean() < 2.5
    assert apart[:, :2].mean() < 2.5
    assert np.all(summary.confidence[:3] > 0.8)
    hidden, others = summary.confidence[-1, 2], summary.confidence[-1, :2]
    assert np.all(others > hidden + 0.1)
    if method != "eskil":  # its ten particles follow too loosely to be sure
        assert hidden < 0.5
        assert np.all(others > 0.8)
    np.testing.assert_allclose(
        jax.nn.sigmoid(state.presence.log_odds), summary.confidence[-1], rtol=1e-6
    )


@pytest.mark.parametrize(
    ("points", "changes", "named"),
    [
        (PLACES, {"window_size": 199}, "199 x 199"),
        (PLACES[[0, 0]], {"method": "pffl"}, "points 0 and 1"),
        (PLACES + 100, {}, "outside the frame"),
    ],
)
def test_bad_input_is_refused(points, changes, named):
    assert named in message_of(jaxpf.points.tracker, PICTURE, points, **changes)


def test_hidden_points_are_drawn_hollow():
    black = np.zeros((60, 60, 3), np.uint8)
    drawn = draw_points(
        black,
        [[15.5, 15.5], [45.5, 15.5], [np.nan, 3]],
        trails=np.full((3, 3, 2), 30.0),
        hidden=[False, True, False],
    ).any(axis=-1)
    assert not black.any()
    assert drawn[[15, 15], [15, 41]].all()
    assert not drawn[15, 45]


def test_names_of_crowded_points_are_apart_and_cover_no_point():
    black = np.zeros((270, 480, 3), np.uint8)
    places = np.array([[240 + 18 * i, 135 + 14 * j] for i in range(4) for j in range(3)], float)
    names = [f"point {number}" for number in range(12)]
    bare = draw_points(black, places)
    drawn = draw_points(black, places, names=names)
    marked = bare.any(axis=-1)
    np.testing.assert_array_equal(drawn[marked], bare[marked])
    # Names without a place beside their point are listed in the corner.
    assert drawn[:40, :60].any()
    few = draw_points(black, places[:2] * [1, 1.3], names=names[:2])
    assert not few[:40, :60].any()


class _Source:
    width, height, path = 156, 120, "clip"


NOTHING = {"point": (), "points": None, "mask": None, "mask_step": None}


def start_of(**given):
    return POINTS.read_start(NOTHING | given, 0, _Source)


def test_the_target_says_where_points_start():
    start = start_of(point=("40.5,40.5,nose", "70.5,45.5"))
    assert start.ids.tolist() == ["nose", "1"]
    np.testing.assert_array_equal(start.shapes, PLACES[:2])
    assert POINTS.outlines(start.shapes, start.sizes).shape == (2, 4, 2)
    values = {"likelihood.sigma": 0.2, "dynamics.scale": 3.0}
    tuned = with_tuned(POINTS, defaults_of(POINTS.tracker), values)
    assert (tuned["sigma"], tuned["noise_points"]) == (0.2, 3.0)


@pytest.fixture
def mask(tmp_path):
    """A picture with a square body."""
    mask = np.zeros((120, 156), np.uint8)
    mask[20:60, 40:80] = 255
    return write_pictures(tmp_path, [mask, mask[:50], 0 * mask])


def test_a_grid_of_points_starts_on_a_mask(mask):
    start = start_of(mask=mask / "0.png")
    np.testing.assert_array_equal(start.shapes, [[50, 30], [70, 30], [50, 50], [70, 50]])
    assert len(start_of(mask=mask / "0.png", mask_step=10.0).shapes) == 16


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"point": ("1,2",), "points": "file"}, "both given"),
        ({}, "--point"),
        ({"point": ("1",)}, "point '1'"),
        ({"point": ("200,3,nose",)}, "'nose' is at (200, 3)"),
        ({"point": ("1,2",), "mask_step": 5.0}, "--mask-step"),
        ({"mask": "0.png", "mask_step": 0.5}, "step=0.5"),
        ({"mask": "1.png"}, "156 x 50"),
        ({"mask": "2.png"}, "0 everywhere"),
        ({"mask": "none.png"}, "none.png"),
    ],
)
def test_starts_that_cannot_be_are_refused(mask, given, named):
    if "mask" in given:
        given = given | {"mask": mask / given["mask"]}
    assert named in message_of(start_of, **given)


@pytest.fixture(scope="module")
def face():
    return scenes.make("face", seed=0, num_frames=2, frame_width=640, frame_height=400)


@pytest.mark.slow
def test_the_target_starts_from_a_scene(face):
    start = POINTS.scene_start(face)
    learned = [
        build(POINTS, {"window_size": 21, "slip": 0}, start, Looks(face.frames[0], patches))
        for patches in (None, face.patches)
    ]
    np.testing.assert_allclose(
        *(np.asarray(one.likelihood.references) for one in learned), rtol=1e-5
    )
    hidden = dict(face.extras) | {"visible": face.extras["visible"] & (np.arange(18) != 3)}
    message = message_of(POINTS.scene_start, dataclasses.replace(face, extras=hidden))
    assert "'left eye inner' of scene 'face' is hidden" in message


def test_windows_of_scenes_have_the_size_that_was_asked_for(face):
    start, looks = POINTS.scene_start(face), looks_of_scene(face, 10)
    for side in (31, 13):
        made = build(POINTS, {"window_size": side, "slip": 0}, start, looks)
        assert made.likelihood.window == (side, side)


def test_points_of_a_stored_evaluation_which_knows_numbers_are_drawn():
    start = Start(np.array([1, 2]), PLACES[:2], np.full((2, 2), 21.0), (-1, -1))
    marks = Marks(np.full((2, 3), 255, np.uint8), np.zeros(2, bool))
    drawn = POINTS.draw(PICTURE, start, PLACES[:2], marks)
    assert (drawn != PICTURE).any()
    doubtful = POINTS.draw(
        PICTURE, start, PLACES[:2], marks._replace(doubtful=np.array([True, False]))
    )
    named = draw_points(PICTURE, PLACES[:2], colours=marks.colours, names=["1 ?", "2"])
    np.testing.assert_array_equal(doubtful, named)
    assert (doubtful != drawn).any()


def test_points_slip_on_film_and_not_in_drawn_scenes(face):
    """The slip was measured on joints of filmed animals; asking for another value wins."""
    filmed = dataclasses.replace(face, settings={})
    for values, slips in (({}, [0.0, 8.0]), ({"slip": 3.0}, [3.0, 3.0])):
        given = Configuration("pffl", parameters={"method": "pffl", **values})
        trackers = [tracker_of(scene, POINTS, given) for scene in (face, filmed)]
        assert [float(tracker.likelihood.slip) for tracker in trackers] == slips
    assert jaxpf.points.tracker(PICTURE, PLACES).likelihood.slip == 8


def test_intervals_in_tracks_are_widened_by_the_slip():
    particles = PLACES + np.random.default_rng(1).normal(0, 3, (20_000, 3, 2))
    slips, deviations = np.array([0.0, 4.0, 7**0.5]), np.array([3.0, 5.0, 4.0])
    error = slips[:, None] * [1, 1, 0]
    for slots in (slice(None), np.array([2, 0])):  # all points, or those that are reported
        places = columns_of(POINTS, POINTS.start(PLACES), particles, error, slots)
        width = np.stack([places[f"{x}_97.5"] - places[f"{x}_2.5"] for x in "xy"], axis=1)
        expected = 3.92 * np.tile(deviations[slots, None], 2)
        # 4.5 standard errors of two 2.5% quantiles.
        np.testing.assert_allclose(width, expected, atol=4.5 * 1.42 * 3 * 2.7 / 141)
