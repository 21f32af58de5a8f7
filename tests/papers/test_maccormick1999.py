"""maccormick1999: what is measured is what is said; small versions of every part."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from judged import verdicts

import jaxpf
from jaxpf.papers.checkpoints import UNSTORED
from jaxpf.papers.judging.claims import NOT_SEEN, PREVIEW, SUPPORTED
from jaxpf.papers.maccormick1999 import scenes as cases, study, toy
from jaxpf.papers.maccormick1999.study import PAPER
from jaxpf.papers.study import Study


def study_of(**kinds):
    """A study of the outcomes of each kind and method, each with its case."""
    values = {}
    for kind, methods in kinds.items():
        for name, outcomes in methods.items():
            for case, outcome in outcomes:
                of_run = study.measures(case, outcome) | {"N": 9}
                for what, value in of_run.items():
                    values.setdefault((f"{kind}: {what}", name, ""), []).append(value)
    return Study(values)


def test_one_target_peaks_at_every_feature_and_two_do_not_share_one():
    together, apart = toy.peaks()
    assert together.max() < 0.1 * apart.min()
    alone = toy.likelihood(np.array([[-50.0, -32.0]]))
    assert alone[0] > 5 * alone[1]
    assert toy.ratio_of_peaks() < 0.1


@pytest.fixture(scope="module")
def wires():
    return cases.wires(0, num_frames=40)


def test_a_case_starts_on_its_targets_and_learns_from_other_seeds(wires):
    tracker = cases.tracker_of(wires, cases.Method("wires", "ps", 10))
    start = np.asarray(tracker.likelihood.outline_points(wires.start))
    still = wires._replace(truth=wires.truth[:1])
    gaps = cases.distances(still, start[None])[0]
    assert np.diagonal(gaps).max() < 4
    other = cases.wires(1, num_frames=40)
    np.testing.assert_array_equal(wires.dynamics.noise, other.dynamics.noise)
    assert (wires.frames != other.frames).any()


def test_each_likelihood_has_its_own_noise_and_the_printed_one_that_of_its_rule(wires):
    factors, printed = cases.NOISE_OF_WIRES, cases.NOISE_AS_PRINTED["wires"]
    for exclusion, all_printed, factor in (
        *((exclusion, False, factor) for exclusion, factor in factors.items()),
        ("wires-literal", False, factors["wires"]),
        ("wires-literal", True, printed),
    ):
        method = cases.Method(exclusion, "ps", 10, all_printed=all_printed)
        tracker = cases.tracker_of(wires, method)
        expected = factor * np.asarray(wires.dynamics.noise)
        np.testing.assert_allclose(tracker.dynamics.noise, expected, rtol=1e-6)
    assert (tracker.likelihood.sigma, tracker.likelihood.independence) == (7, 1)
    assert not cases.as_printed(wires._replace(noise={})).noise
    leaves = cases.leaves(0, num_frames=9)
    tracked = cases.tracker_of(leaves, cases.Method("opaque", "ps", 10)).dynamics.dynamics
    factor = cases.NOISE_OF_LEAVES["opaque"]
    np.testing.assert_allclose(tracked.noise, factor * leaves.dynamics.noise, rtol=1e-6)


@pytest.mark.slow
def test_of_two_trackers_neither_depends_on_the_other(wires):
    """Another start of the second target moves the first only where one filter tracks both."""
    moved = wires._replace(start=wires.start + np.float32([[0], [9]]))

    def first_of(case, method):
        tracker = cases.tracker_of(case, cases.Method("none", method, 20))
        _, summary = jaxpf.run(tracker, jax.random.key(0), wires.frames[:3])
        return np.asarray(summary.estimate)[:, 0]

    shifts = {
        method: np.abs(first_of(wires, method) - first_of(moved, method)).max()
        for method in ("independent", "sir")
    }
    assert shifts["independent"] < 1e-3  # rounding of weights, pixels
    assert shifts["sir"] > 0.1


def test_who_ended_where_is_judged_by_the_truth(wires):
    truth = wires.truth
    swapped, on_first = truth[:, ::-1], truth[:, [0, 0]]
    lost = truth + 60
    point = truth[:, :, :1].repeat(truth.shape[2], axis=2)  # lies on its target, and is none of it
    outlines = np.stack([truth, swapped, on_first, lost, point])
    kept, coalesced, exchanged = cases.judged(wires, outlines)
    np.testing.assert_array_equal(kept, (True, False, False, False, False))
    np.testing.assert_array_equal(coalesced, (False, False, True, False, False))
    np.testing.assert_array_equal(exchanged, (False, True, False, False, False))
    half = truth[:, :, : truth.shape[2] // 2]  # distances count both ways
    there = cases.distances(wires, half[None])[0]
    assert np.diagonal(there, axis1=1, axis2=2).min() > 6


def test_claims_follow_from_the_rates(wires):
    outlines = np.stack([wires.truth] * 20)
    kept, none = np.ones(20, bool), np.zeros(20, bool)
    ess, spread, in_front = np.ones((20, 2)), np.ones((20, 2, 2)), np.full((20, 2), np.nan)
    good = cases.Outcome(outlines, ess, spread, kept, none, none, in_front)
    bad = good._replace(kept=none, coalesced=kept)

    def judged(with_exclusion, without):
        outcomes = {
            name: [(wires, without if method.exclusion == "none" else with_exclusion)] * 50
            for name, method in study.WIRES.items()
        }
        return verdicts(PAPER, study_of(wires=outcomes))

    assert list(judged(good, bad).values()) == [SUPPORTED] * 6
    assert list(judged(bad, good).values()) == [NOT_SEEN] * 6


@pytest.fixture(scope="module")
def one_kept_one_lost():
    """A sequence of leaves; of two runs the first keeps both, and is right about who is in front.

    Its hidden contour has three times the spread while it is hidden, and half of it afterwards.
    """
    case = cases.leaves(0, num_frames=30)
    runs, frames = 2, len(case.frames)
    right = np.full((runs, frames), 0.9 if case.farther == 1 else 0.1)
    right[1] = 1 - right[1]
    covered = np.flatnonzero(case.hidden > 0)
    spread = np.ones((runs, frames, 2))
    spread[0, covered] = 3
    spread[0, covered[-1] + 1 :] = 1.5
    spread[1] = 50 + np.arange(frames)[:, None] ** 2
    ends = np.array([True, False]), np.zeros(2, bool), np.zeros(2, bool)
    outlines, ess = np.zeros((runs, frames, 2, 4, 2)), np.ones((runs, frames))
    return case, cases.Outcome(outlines, ess, spread, *ends, right)


def test_labels_are_scored_by_the_truth_and_lost_runs_do_not_widen(one_kept_one_lost):
    case, outcome = one_kept_one_lost
    found = study.measures(case, outcome)
    assert found["label right"] == 0.5
    assert (found["widening"], found["narrowing"]) == (3.0, 0.5)
    lost = study.measures(case, outcome._replace(kept=np.zeros(2, bool)))
    assert np.isnan([lost["widening"], lost["narrowing"]]).all()


def test_claims_of_opaque_targets_follow_from_what_was_tracked(one_kept_one_lost):
    """Of runs that keep both with exclusion and end on one without; and the other way round."""
    case, outcome = one_kept_one_lost
    good, bad = (
        type(outcome)(*(None if value is None else value[[run]] for value in outcome))
        for run in (0, 1)
    )
    bad = bad._replace(coalesced=np.ones(1, bool))
    hidden = case.hidden

    def varied(outcome, k):
        """Spreads differ between sequences, and on one of ten so does one frame's label."""
        spread = np.where(hidden[:, None] > 0, 1 + 0.01 * k, 1) * outcome.spread
        other = (k % 10 == 0) & (np.arange(len(hidden)) == hidden.argmax())
        in_front = np.where(other, 1 - outcome.in_front, outcome.in_front)
        return case, outcome._replace(spread=spread, in_front=in_front)

    all_good, all_bad = ([varied(each, k) for k in range(50)] for each in (good, bad))

    def judged(first, second):
        walkers = {
            study.OCCLUSION: first,
            study.INDEPENDENT: second,
            study.OCCLUSION + study.ALL_PRINTED: first,
        }
        leaves = {
            study.PARTITIONED: first,
            study.PARTITIONED + study.PRINTED: second,
            study.PARTITIONED + study.ALL_PRINTED: second,
            study.ENOUGH: first,
            study.AS_MANY: second,
            study.FOUR_TIMES: second,
        }
        return verdicts(PAPER, study_of(walkers=walkers, leaves=leaves))

    found = judged(all_good, all_bad)
    assert len(found) == 12
    assert found.pop("leaves_printed") == NOT_SEEN
    assert set(found.values()) == {SUPPORTED}
    found = judged(all_bad, all_good)
    # Nothing is said about the spreads of lost targets.
    assert [found.pop("walkers_widen"), found.pop("walkers_narrow")] == [PREVIEW] * 2
    assert found.pop("leaves_printed") == SUPPORTED
    assert set(found.values()) == {NOT_SEEN}


def test_tables_and_figures_show_every_method(one_kept_one_lost):
    case, outcome = one_kept_one_lost
    names = study.PARTITIONED, study.AS_MANY
    methods = dict.fromkeys(names, [one_kept_one_lost] * 25)
    kinds = ("wires", "leaves", "walkers", "figure_11")
    shown = {table.name: table for table in PAPER.tables(study_of(**dict.fromkeys(kinds, methods)))}
    assert list(shown) == ["figure_4_wires", "passing_leaves", "passing_walkers", "figure_11"]
    for table in shown.values():
        assert [label for label, _ in table.rows] == list(names)
    leaves = shown["passing_leaves"]
    cells = dict(zip(leaves.columns[1:], leaves.rows[0][1], strict=True))
    assert cells["both kept (%)"].measured.value == 50
    assert cells["widening"].measured.value == pytest.approx(3)
    assert (cells["N"], cells["sequences"]) == ("9", "25")
    ess = np.ones((25, len(case.frames)))
    of_both = (dict.fromkeys(names, each) for each in (outcome.outlines, ess))
    found = study.Passing(case, *of_both)
    assert len(study.ess_figure(found).axes) == 1
    assert len(study.contours_figure(found).axes) == 6


@pytest.mark.slow
def test_figure_11_counts_lines_in_full_before_the_leaves_overlap():
    case, hidden = cases.leaves_of_figure_11(0), cases.leaves(0).hidden
    assert (case.options["independence"], case.hidden) == (1, None)
    assert len(case.frames) == len(case.truth) == cases.FIRST_FRAMES
    assert hidden[: cases.FIRST_FRAMES].max() == 0 < 0.3 < hidden.max()
    assert {method.one_in for method in study.FIGURE_11.values()} == {1}


def test_slow_filters_track_the_first_sequences(monkeypatch, wires):
    seen = []

    def track(case, particles, runs, seed):
        seen.append((particles, seed))
        ends = [np.array([seed == 2])] * 3
        return cases.Outcome(*[np.zeros((1, 10, 2))] * 3, *ends, np.zeros((1, 10)))

    monkeypatch.setattr(study, "tracker_of", lambda case, method: method.num_particles)
    monkeypatch.setattr(study, "track", track)
    methods = {"a": study.Method("wires", "ps", 1), "b": study.Method("none", "sir", 2, 3)}
    values, shown = study.measure("wires", lambda _: wires, methods, range(4), UNSTORED)
    assert seen == [(1, 0), (2, 0), (1, 1), (2, 1), (1, 2), (2, 2), (1, 3)]
    np.testing.assert_array_equal(values["wires: kept", "a", ""], [0, 0, 1, 0])
    np.testing.assert_array_equal(values["wires: N", "b", ""], [2, 2, 2])
    assert [len(shown.outlines[name]) for name in methods] == [1, 1]
    assert [len(shown.ess[name]) for name in methods] == [4, 3]


@pytest.mark.slow
@pytest.mark.parametrize("method", [toy.CONVENTIONAL, toy.BRANCHED])
def test_the_steps_of_the_toy_are_the_filters_own(method):
    tracker, key = toy.tracker_of(method), jax.random.key(5)
    init_key, step_key = jax.random.split(key)
    frame = jnp.asarray(toy.TARGET).reshape(2, 1)
    state, _ = jax.jit(tracker.step)(step_key, jax.jit(tracker.init)(init_key), frame)
    _, moved, _, last = jax.jit(lambda: toy.frame(tracker, key))()
    np.testing.assert_allclose(last[0], state.lagged[0, 0], rtol=1e-5)
    np.testing.assert_allclose(last[1], state.log_weights, rtol=1e-4)
    # Each particle has moved the target that its label says, and no other: as large a spread as
    # that of prior and dynamics together, beside the prior's.
    first = np.asarray(moved[2])
    for target in set(first):
        spread = np.asarray(moved[0])[:, first == target].std(axis=1)
        assert spread[target] > 1.5 * spread[1 - target]
    assert set(first) == ({0, 1} if method == toy.BRANCHED else {0})


@pytest.mark.slow
def test_the_toy_shows_that_partitioned_sets_are_finer():
    values = {("toy: ess", name, ""): steps[-1].ess for name, steps in toy.steps(0).items()}
    assert verdicts(PAPER, Study(values)) == {"toy": SUPPORTED}
