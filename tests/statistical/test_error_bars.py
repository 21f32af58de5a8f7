"""Error bars from one run against the variance over many: the clock of frames."""

import jax
import numpy as np
import pytest
from exact import LIMIT, TREE, monte_carlo, objects, problem

from jaxpf import ordering
from jaxpf.filters import WithErrorBars

pytestmark = pytest.mark.statistical


def bars(state, summary):
    known = summary.estimate_variance[:, 0], summary.evidence_variance, summary.unknown
    return summary.estimate[:, 0], summary.log_evidence, *known


def ratios(exact, tracker, runs, batch, **settings):
    """Mean variance told by single runs over that among runs, for estimates and the evidence.

    Returns:
        Ratios and standard errors ``[P + 1]``, the evidence last; and the share of runs ``[P]``
        that did not know, in the last frame.
    """
    keys = jax.random.split(jax.random.key(5), runs)
    its = WithErrorBars(tracker, **settings)
    found = monte_carlo(its, keys, exact.frames, record=bars, batch_size=batch)
    estimate, log_evidence, told, of_evidence, unknown = jax.tree.map(np.asarray, found)
    scale = np.exp(log_evidence.sum(1) - exact.log_evidence.sum())
    answers = np.column_stack([estimate[:, -1], scale])
    # The estimate is unbiased for the variance of the evidence if weighted by its square.
    told = np.column_stack([told[:, -1], of_evidence[:, -1] * scale**2])
    variance = answers.var(axis=0, ddof=1)
    squares = (answers - answers.mean(0)) ** 2
    ratio = np.nanmean(told, axis=0) / variance
    count = np.sum(~np.isnan(told), axis=0)
    spread = (np.nanstd(told, axis=0) / np.nanmean(told, axis=0)) ** 2 / np.maximum(count, 1)
    error = ratio * np.sqrt(spread + (squares.std(0) / variance) ** 2 / runs)
    return ratio, error, unknown[:, -1].mean(0)


#: Problem, order, and the lag: 40 selections leave fewer than sqrt(N) ancestors of the start.
CASES = {
    "sir": (lambda: problem((-1, -1), num_frames=10), ordering.sir(2), None),
    "tree": (lambda: problem(TREE, num_frames=10), ordering.ps([0, 1, 2]), None),
    "ps-lag": (lambda: objects(num_frames=10), ordering.ps([2, 0, 3, 1]), 3),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_one_run_tells_the_variance_over_many(case):
    make, order, lag = CASES[case]
    exact = make()
    tracker = exact.tracker(order, num_particles=2000, resampling="multinomial")
    ratio, error, unknown = ratios(exact, tracker, 5000, 25, lag=lag)
    print(f"{case}: ratios {ratio.round(3)} +- {error.round(3)}, unknown {unknown.round(3)}")
    assert np.isnan(ratio[-1]) == (lag is not None)  # a lag says nothing of the evidence
    assert (np.abs(ratio[np.isfinite(ratio)] - 1) < 0.1).all()


@pytest.mark.slow
def test_skipped_selections_are_not_counted():
    """Of ten about two happen."""
    exact = problem((-1,), num_frames=10)
    settings = {"num_particles": 400, "resampling": "multinomial", "ess_threshold": 0.3}
    tracker = exact.tracker(ordering.sir(1), **settings)
    ratio, error, unknown = ratios(exact, tracker, 5000, 250)
    print(f"ratios {ratio.round(3)} +- {error.round(3)}, unknown {unknown.round(3)}")
    assert (unknown == 0).all()
    assert (np.abs(ratio - 1) < np.maximum(0.1, LIMIT * error)).all()


#: What the library particles 0.4 tells of ten frames of ``problem((-1,))``: mean and standard error
#: over 2000 runs after ``np.random.seed(1)``, of ``SMC(fk=Bootstrap(ssm=..., data=frames), N=2000,
#: resampling="multinomial", ESSrmin=1, collect=[Var(), Var_logLt(), Lag_based_var()],
#: store_history=4)`` at the last frame, with the factor (N / (N - 1))^G that it leaves out.
BY_PARTICLES = {
    "estimate": (6.2167e-4, 0.0197e-4),
    "evidence": (4.2736e-3, 0.0153e-3),
    "estimate, lag 3": (6.2226e-4, 0.0154e-4),
}


@pytest.mark.slow
def test_the_plain_filter_agrees_with_another_library():
    exact = problem((-1,), num_frames=10)
    tracker = exact.tracker(ordering.sir(1), num_particles=2000, resampling="multinomial")
    keys = jax.random.split(jax.random.key(5), 2000)
    whole, lagged = (
        monte_carlo(
            WithErrorBars(tracker, lag=lag), keys, exact.frames, record=bars, batch_size=100
        )
        for lag in (None, 3)
    )
    ours = dict(
        zip(BY_PARTICLES, (whole[2][:, -1, 0], whole[3][:, -1], lagged[2][:, -1, 0]), strict=True)
    )
    for name, (theirs, error) in BY_PARTICLES.items():
        told = np.asarray(ours[name])
        z = (told.mean() - theirs) / np.hypot(told.std(ddof=1) / len(told) ** 0.5, error)
        print(f"{name}: {told.mean():.4g}, particles {theirs:.4g}, z = {z:.2f}")
        assert abs(z) < LIMIT
