"""gonzales2011 repeated: what is measured, and how it becomes tables, claims and figures."""

from contextlib import suppress

import jax
import numpy as np
import pytest

import scenes as drawn
from jaxpf import run
from jaxpf.measures import corner_distances
from jaxpf.papers import gonzales2011
from jaxpf.papers.checkpoints import keeping
from jaxpf.papers.gonzales2011 import figures, published, scenes, tables
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, METHODS, VARIANTS, Outcome
from jaxpf.papers.judging.claims import NOT_SEEN, OPEN, SUPPORTED, judge_all
from jaxpf.papers.judging.comparison_table import Comparison, write
from jaxpf.papers.judging.estimates import gain_of
from jaxpf.shapes import corners_from_poses

FRAMES = 7
CELL = ("smooth", 3, (12,))


@pytest.fixture(scope="module")
def measured():
    return scenes.measure([CELL], seeds=(0, 1), num_frames=FRAMES)["smooth", 3, 12]


@pytest.mark.slow
def test_every_method_is_measured_on_every_sequence(measured):
    for values in measured:
        assert values.shape == (2, len(METHODS), len(DYNAMICS), FRAMES - 1)
        assert np.isfinite(values).all()
        assert (values > 0).all()
    # Twelve corners, each some pixels away: a tracker that lost the object is far above.
    assert measured.error.mean(axis=(0, 3)).max() < 12 * 8


@pytest.mark.slow
def test_methods_dynamics_and_sequences_really_differ(measured):
    last = measured.error[..., -1].ravel()
    assert len(np.unique(last)) == len(last)


@pytest.mark.slow
def test_a_run_depends_on_its_sequence_and_seed_alone(measured):
    swapped = scenes.measure([CELL], seeds=(1, 0), num_frames=FRAMES)["smooth", 3, 12]
    np.testing.assert_array_equal(measured.error[::-1], swapped.error)


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
        np.testing.assert_allclose(measured.of("error", variant)[1], error, rtol=1e-3)


def test_absolute_parts_walk_alone_and_relative_ones_follow_their_parents():
    scene = drawn.make("articulated", 0, num_parts=5, num_frames=2)
    grid = scenes.grid(scene, "erratic", 4)
    alone = [[True] * 5, [True] + [False] * 4]
    np.testing.assert_array_equal(grid.columns.walks_alone, alone)


def test_what_was_tracked_before_a_stop_is_not_tracked_again(tmp_path, monkeypatch):
    def tracked(motion, parts, particles, num_frames, seed):
        asked.append((motion, parts, seed))
        shape = len(particles), len(METHODS), len(DYNAMICS), num_frames - 1
        return {what: np.full(shape, 7.0 + seed) for what in Outcome._fields}

    asked = []
    monkeypatch.setattr(scenes, "_on_scene", tracked)
    for _ in range(2):
        with suppress(KeyboardInterrupt), keeping(tmp_path, {}):
            found = scenes.measure([("smooth", 3, (10,))], (0, 1), 4)["smooth", 3, 10]
            raise KeyboardInterrupt
    assert sorted(asked) == [("smooth", 3, 0), ("smooth", 3, 1)]
    for variant in VARIANTS:
        np.testing.assert_array_equal(found.of("error", variant), [[7.0] * 3, [8.0] * 3])


def fake_outcome(gains, variance_gains=None, num_scenes=4, spread=0.5):
    """Outcomes in which a method has so many per cent less error than PS, give or take."""
    rng = np.random.default_rng(0)

    def values(gains):
        less = np.array([gains.get(method, 0.0) for method in METHODS])[:, None, None]
        noise = spread * rng.normal(size=(num_scenes, len(METHODS), len(DYNAMICS), 1))
        return (100 - less + noise) * np.ones(9)

    return Outcome(values(gains), values(variance_gains or gains))


def everything(outcome):
    cells = [("smooth", p, n) for p in (7, 9) for n in published.FIGURE_8_PARTICLES]
    cells += [("strong_start", p, 20) for p in published.PARTS] + [("erratic", 5, 10)]
    return dict.fromkeys(cells, outcome)


def verdicts(outcomes):
    figures = gonzales2011.PAPER.quantities(outcomes)
    return {each.claim.key: each.verdict for each in judge_all("gonzales2011", figures)}


def test_claims_follow_what_was_measured():
    gains = {"SPS sorted": 12.0, "SPS combinatorial": -12.0}
    found = verdicts(everything(fake_outcome(gains, {"SPS sorted": 0.0}, num_scenes=25)))
    assert len(found) == 15
    for key, verdict in found.items():
        expected = {NOT_SEEN if key.startswith("combinatorial") else SUPPORTED}
        if key.endswith("variance"):
            # No gain is not a considerable one, and within the margin of a gain.
            expected = {NOT_SEEN} if "erratic" in key else {"equal within 3", OPEN}
        assert verdict in expected, key
    computed = gonzales2011.PAPER.computed()
    judged = judge_all("gonzales2011", {"resamplings": computed["resamplings"]})
    assert [each.verdict for each in judged] == [SUPPORTED]
    assert [part.what for part in computed["resamplings"]] == ["7 parts, 7 / 4", "9 parts, 9 / 5"]


def test_one_bad_cell_contradicts_its_claim_alone():
    outcomes = everything(fake_outcome({"SPS sorted": 8.0}, num_scenes=25))
    outcomes["smooth", 7, 40] = fake_outcome({"SPS sorted": -8.0}, num_scenes=25)
    found = verdicts(outcomes)
    own = [key for key in found if not key.startswith("combinatorial")]
    assert [key for key in own if found[key] == NOT_SEEN] == ["error"]
    assert verdicts({}) == {}


def test_gains_are_per_cent_of_ps_sequence_by_sequence():
    ours, base = np.array([15.0, 60.0] * 15), np.array([20.0, 60.0] * 15)
    found = gain_of(ours, base)
    np.testing.assert_allclose(found.value, 100 * (1 - np.sqrt(0.75)))
    low, high = found.interval(0.9)
    assert low < found.value < high


def test_two_methods_that_lose_as_much_by_turns_are_equal():
    ours = np.array([10.0, 40.0] * 10)
    assert gain_of(ours, ours[::-1]).value == pytest.approx(0)


def test_everything_is_written(tmp_path):
    outcomes = everything(fake_outcome({"SPS sorted": 8.0}))
    comparison = Comparison(
        paper="gonzales2011",
        title="a test",
        tables=tables.tables(outcomes),
        claims=judge_all("gonzales2011", gonzales2011.PAPER.quantities(outcomes)),
        figures=figures.figures(outcomes),
        notes=gonzales2011.NOTES,
    )
    written = write(comparison, tmp_path)
    assert {"figure_8_7_parts.png", "figure_9.png", "figure_10.png", "figure_11.png"} <= set(
        written
    )
    text = (tmp_path / "gonzales2011.md").read_text()
    assert "erratic, 5 parts, N = 10" in text
