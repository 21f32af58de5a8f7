"""gonzales2011 repeated: what is measured, and how it becomes tables, claims and figures."""

from contextlib import suppress

import numpy as np
import pytest

from jaxpf.papers import gonzales2011
from jaxpf.papers.checkpoints import keeping
from jaxpf.papers.gonzales2011 import claims, figures, published, scenes, tables
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, METHODS, RUNS_PER_SCENE, Outcome
from jaxpf.papers.judging.claims import NOT_SEEN, OPEN, SUPPORTED, judge_all
from jaxpf.papers.judging.comparison_table import Comparison, write

FRAMES = 7
CELL = scenes.Cell("smooth", 3, (12,))
KINDS = [(dynamics, method) for dynamics in DYNAMICS for method in METHODS]


@pytest.fixture(scope="module")
def measured():
    return scenes.measure([CELL], seeds=(0, 1), num_frames=FRAMES)["smooth", 3, 12]


@pytest.mark.slow
def test_every_method_is_measured_on_every_sequence_and_run(measured):
    assert set(measured.error) == set(measured.variance) == set(KINDS)
    for values in (*measured.error.values(), *measured.variance.values()):
        assert values.shape == (2, RUNS_PER_SCENE, FRAMES - 1)
        assert np.isfinite(values).all()
        assert (values > 0).all()
    for error in measured.error.values():
        # Twelve corners, each some pixels away: a tracker that lost the object is far above.
        assert error.mean() < 12 * 8


@pytest.mark.slow
def test_methods_and_dynamics_really_differ_and_runs_do_too(measured):
    errors = [values.ravel() for values in measured.error.values()]
    for first in range(len(errors)):
        for second in range(first):
            assert not np.allclose(errors[first], errors[second])
    runs = measured.error["absolute", "PS"].reshape(-1, FRAMES - 1)
    assert len(np.unique(runs[:, -1])) == len(runs)


@pytest.mark.slow
def test_a_run_depends_on_its_sequence_and_seed_alone(measured):
    swapped = scenes.measure([CELL], seeds=(1, 0), num_frames=FRAMES)["smooth", 3, 12]
    for kind in KINDS:
        np.testing.assert_array_equal(measured.error[kind][::-1], swapped.error[kind])


def test_trackers_of_all_methods_have_one_shape():
    import jax

    from scenes import make

    scene = make("articulated", 0, num_parts=5, num_frames=2)
    found = scenes.trackers(scene, scenes.learn(scene), "erratic", 4)
    assert set(found) == set(KINDS)
    assert len({jax.tree.structure(tracker) for tracker in found.values()}) == 1
    assert len({str(jax.tree.map(np.shape, tracker)) for tracker in found.values()}) == 1
    alone = found["absolute", "PS"].dynamics.walks_alone
    assert np.all(alone)
    assert np.asarray(found["relative", "PS"].dynamics.walks_alone).tolist() == [True] + [False] * 4


def test_what_was_tracked_before_a_stop_is_not_tracked_again(tmp_path, monkeypatch):
    def tracked(cell, *_):
        asked.append(cell[:2])
        return {
            "10": {
                what: {kind: {m: np.full((2, 5, 3), 7.0) for m in METHODS} for kind in DYNAMICS}
                for what in Outcome._fields
            }
        }

    asked = []
    monkeypatch.setattr(scenes, "_measured", tracked)
    for _ in range(2):
        with suppress(KeyboardInterrupt), keeping(tmp_path, {}):
            found = scenes.measure([scenes.Cell("smooth", 3, (10,))], (0, 1), 4)["smooth", 3, 10]
            raise KeyboardInterrupt
    assert asked == [("smooth", 3)]
    assert set(found.variance) == set(KINDS)
    np.testing.assert_array_equal(found.error["relative", "PS"], np.full((2, 5, 3), 7.0))


def fake_outcome(gains, variance_gains=None, num_scenes=4, spread=0.5):
    """Outcomes in which a method has so many per cent less error than PS, give or take."""
    rng = np.random.default_rng(0)

    def values(gain):
        noise = spread * rng.normal(size=(num_scenes, 1, 1))
        return np.full((num_scenes, RUNS_PER_SCENE, 9), 1.0) * (100 - gain + noise)

    by_gain = {"PS": 0.0} | gains
    by_variance = {"PS": 0.0} | (variance_gains or gains)
    return Outcome(
        error={(d, m): values(by_gain.get(m, 0.0)) for d, m in KINDS},
        variance={(d, m): values(by_variance.get(m, 0.0)) for d, m in KINDS},
    )


def everything(outcome):
    cells = [("smooth", p, n) for p in (7, 9) for n in published.FIGURE_8_PARTICLES]
    cells += [("strong_start", p, 20) for p in published.PARTS] + [("erratic", 5, 10)]
    return dict.fromkeys(cells, outcome)


def verdicts(measured):
    return {each.claim.key: each.verdict for each in judge_all("gonzales2011", measured)}


def test_claims_follow_what_was_measured():
    gains = {"SPS sorted": 12.0, "SPS combinatorial": -12.0}
    outcomes = everything(fake_outcome(gains, {"SPS sorted": 0.0}, num_scenes=25))
    for dynamics, swap, expected in (
        ("absolute", "sorted", SUPPORTED),
        ("absolute", "combinatorial", NOT_SEEN),
        ("relative", "combinatorial", NOT_SEEN),
    ):
        found = verdicts(claims.of_curves(outcomes, dynamics, swap))
        assert len(found) == 5
        for key, verdict in found.items():
            # No gain is not a considerable one, and within the margin of a gain.
            without = {NOT_SEEN} if "erratic" in key else {"equal within 3", OPEN}
            assert verdict in (without if key.endswith("variance") else {expected}), key
    assert verdicts({"resamplings": claims.resamplings()}) == {"resamplings": SUPPORTED}
    assert [part.what for part in claims.resamplings()] == ["7 parts, 7 / 4", "9 parts, 9 / 5"]


def test_one_bad_cell_contradicts_its_claim_alone():
    outcomes = everything(fake_outcome({"SPS sorted": 8.0}, num_scenes=25))
    outcomes["smooth", 7, 40] = fake_outcome({"SPS sorted": -8.0}, num_scenes=25)
    found = verdicts(claims.of_curves(outcomes, "absolute", "sorted"))
    assert [key for key, verdict in found.items() if verdict == NOT_SEEN] == ["error"]
    assert claims.of_curves({}, "absolute", "sorted")["error"] == []


def test_gains_are_per_cent_of_ps_sequence_by_sequence():
    ours, base = np.array([15.0, 60.0] * 15), np.array([20.0, 60.0] * 15)
    found = tables.gain(ours, base)
    np.testing.assert_allclose(found.value, 100 * (1 - np.sqrt(0.75)))
    low, high = found.interval(0.9)
    assert low < found.value < high


def test_two_methods_that_lose_as_much_by_turns_are_equal():
    ours = np.array([10.0, 40.0] * 10)
    assert tables.gain(ours, ours[::-1]).value == pytest.approx(0)


def test_everything_is_written(tmp_path):
    outcomes = everything(fake_outcome({"SPS sorted": 8.0}))
    comparison = Comparison(
        paper="gonzales2011",
        title="a test",
        tables=tables.tables(outcomes),
        claims=judge_all("gonzales2011", claims.of_curves(outcomes, "absolute", "sorted")),
        figures=figures.figures(outcomes),
        notes=gonzales2011.NOTES,
    )
    written = write(comparison, tmp_path)
    assert {"figure_8_7_parts.png", "figure_9.png", "figure_10.png", "figure_11.png"} <= set(
        written
    )
    text = (tmp_path / "gonzales2011.md").read_text()
    assert "erratic, 5 parts, N = 10" in text
