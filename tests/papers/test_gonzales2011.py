"""gonzales2011 repeated: what is measured, and how it becomes tables, claims and figures."""

import jax
import numpy as np
import pytest
from judged import verdicts

import scenes as drawn
from jaxpf import run
from jaxpf.measures.particle_sets import corner_distances
from jaxpf.papers.gonzales2011 import scenes
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, METHODS, VARIANTS
from jaxpf.papers.gonzales2011.study import FIGURES, PAPER, study_of
from jaxpf.papers.judging.claims import NOT_SEEN, OPEN, SUPPORTED, judge_all
from jaxpf.shapes.rectangles import corners_from_poses

FRAMES = 7
CELL = ("smooth", 3, (12,))


def measured_on(seeds):
    return scenes.measure([CELL], seeds, FRAMES)["smooth", 3, 12]


@pytest.fixture(scope="module")
def measured():
    return measured_on(range(2))


@pytest.mark.slow
def test_every_method_is_measured_on_every_sequence_by_its_seed_alone(measured):
    assert len(measured) == 2 * len(METHODS) * len(DYNAMICS)
    for key, alone in measured_on(range(1, 2)).items():
        values = measured[key]
        assert values.shape == (2, FRAMES - 1)
        assert (np.isfinite(values) & (values > 0)).all()
        np.testing.assert_array_equal(values[1:], alone)
    errors = np.array([measured["error", variant] for variant in VARIANTS])
    # Twelve corners, each some pixels away: a tracker that lost the object is far above.
    assert errors.mean(axis=(1, 2)).max() < 12 * 8
    assert len(np.unique(errors[..., -1])) == errors[..., -1].size


@pytest.mark.slow
def test_a_method_in_the_grid_tracks_as_it_does_alone(measured):
    scene = drawn.make("articulated", 1, num_parts=3, motion="smooth", num_frames=FRAMES)
    grid = scenes.grid(scene, "smooth", 12)
    for variant, (row, column) in VARIANTS.items():
        tracker = grid.build(
            jax.tree.map(lambda x: x[row], grid.rows),  # noqa: B023
            jax.tree.map(lambda x: x[column], grid.columns),  # noqa: B023
        )
        _, alone = jax.jit(run)(tracker, jax.random.key(1), scene.frames[1:])
        corners = corners_from_poses(alone.estimate[:, :, :3], scene.sizes)
        error = corner_distances(corners, scene.extras["corners"][1:])
        np.testing.assert_allclose(measured["error", variant][1], error, rtol=1e-3)


def test_absolute_parts_walk_alone_and_relative_ones_follow_their_parents():
    scene = drawn.make("articulated", 0, num_parts=5, num_frames=2)
    grid = scenes.grid(scene, "erratic", 4)
    alone = [[True] * 5, [True] + [False] * 4]
    np.testing.assert_array_equal(grid.columns.walks_alone, alone)


def made(gains, variance_gains=None):
    """Curves in which a method has so many per cent less error than PS, give or take."""
    rng = np.random.default_rng(0)
    gains = {"error": gains, "variance": variance_gains or gains}
    return {
        (field, variant): (
            100 - of.get(variant.split(",")[0], 0.0) + 0.5 * rng.normal(size=(25, 1))
        )
        * np.ones(9)
        for field, of in gains.items()
        for variant in VARIANTS
    }


def everything(curves):
    figures = FIGURES.values()
    return {
        (motion, parts, number): curves
        for _, motion, sizes, numbers in figures
        for parts in sizes
        for number in numbers
    }


def test_claims_follow_what_was_measured():
    gains = {"SPS sorted": 12.0, "SPS combinatorial": -12.0}
    found = verdicts(PAPER, study_of(everything(made(gains, {"SPS sorted": 0.0}))))
    assert len(found) == 15
    for key, verdict in found.items():
        expected = {NOT_SEEN if key.startswith("combinatorial") else SUPPORTED}
        if key.endswith("variance"):
            # No gain is not a considerable one, and within the margin of a gain.
            expected = {NOT_SEEN} if "erratic" in key else {"equal within 3", OPEN}
        assert verdict in expected, key
    computed = PAPER.computed()
    judged = judge_all("gonzales2011", {"resamplings": computed["resamplings"]})
    assert [each.verdict for each in judged] == [SUPPORTED]
    assert [part.what for part in computed["resamplings"]] == ["7 parts, 7 / 4", "9 parts, 9 / 5"]


def test_one_bad_cell_contradicts_its_claim_alone():
    curves = everything(made({"SPS sorted": 8.0}))
    curves["smooth", 7, 40] = made({"SPS sorted": -8.0})
    found = verdicts(PAPER, study_of(curves))
    own = [key for key in found if not key.startswith("combinatorial")]
    assert [key for key in own if found[key] == NOT_SEEN] == ["error"]
    assert verdicts(PAPER, study_of({})) == {}


def test_a_strong_start_is_judged_while_it_is_strong():
    ps = np.full((25, 299), 100.0)
    sps = np.where(np.arange(299) < 60, 80.0, 200.0) * np.ones((25, 1))
    curve = {("error", variant): ps if variant.startswith("PS") else sps for variant in VARIANTS}
    curve |= {("variance", variant): ps for variant in VARIANTS}
    found = study_of({("strong_start", 3, 20): curve})
    (gain,) = found.figures("gain", "figure 10", "SPS sorted, absolute", "PS, absolute")
    assert gain.value == pytest.approx(20)


def test_erratic_motion_has_twice_as_many_sequences(monkeypatch):
    def tracked(motion, parts, particles, num_frames, seed):
        return {what: np.full((1, 4, 2, 3), float(seed)) for what in ("error", "variance")}

    monkeypatch.setattr(scenes, "_on_scene", tracked)
    cells = [("smooth", 3, (12,)), ("erratic", 5, (10,))]
    found = scenes.measure(cells, range(4, 6), FRAMES)
    seeds = [list(curve["error", "PS, absolute"][:, 0]) for curve in found.values()]
    assert seeds == [[4, 5], [4, 5, 6, 7]]


def test_tables_and_figures_show_every_cell():
    found = study_of(everything(made({"SPS sorted": 8.0})))
    shown = {table.name: table for table in PAPER.tables(found)}
    assert len(shown) == 6
    rows = dict(shown["gain_relative"].rows)
    assert rows["erratic, 5 parts, N = 10"][0].measured.value == pytest.approx(8, abs=0.5)
    names = ("figure_8_7_parts", "figure_8_9_parts", "figure_9", "figure_10", "figure_11")
    assert set(PAPER.figures(found)) == set(names)
