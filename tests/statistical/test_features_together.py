"""Features by features: configurations that cover all pairs, each right or refused.

A configuration takes one level of every factor; the covering array holds every pair of levels but
those of ``REFUSED``, each of which is refused in one sentence.  The model is linear and Gaussian,
so that evidence, means and second moments are known: a run is right if they are unbiased.
Smoothing, particle Gibbs and pmmh run frames by themselves, whichever the way to run.
"""

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import COMPILER_OPTIONS, LIMIT, monte_carlo_once
from featured_trackers import (
    FLIP,
    START_LABEL,
    N,
    P,
    T,
    exact,
    frames_of,
    model_of,
    tracker_of,
)
from features import PAIRS_REFUSED, covering_array, default_with, shown

import jaxpf
from jaxpf import InputError, smoothing
from jaxpf.contract.calls import changed_inside

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

RUNS = 3000


def record(state, summary):
    return summary.log_evidence, summary.estimate, summary.spread, summary.label_probabilities


def z_scores(samples, expected):
    samples = np.asarray(samples)
    assert samples.dtype == np.float64
    error = samples.std(axis=0, ddof=1) / len(samples) ** 0.5
    return np.ravel(np.abs(samples.mean(axis=0) - expected) / error)


def changed(config, made, factors):
    """The tracker with noises multiplied by ``factors``."""
    model = model_of(config, factors)
    for name in ("dynamics", "likelihood"):
        made = changed_inside(made, name, lambda _, name=name: model[name])
    return made


def one_run(config, made):
    """A function of (factors, key): the evidence, and what is recorded ``[T, ...]``, and ahead."""
    frames, observed = frames_of(config)
    seen = (None, None) if observed is None else (observed[:2], observed[2:])

    def run(factors, key):
        its = made if factors is None else changed(config, made, factors)
        state, found = None, None
        if "resume" in config:
            state, found = jaxpf.run(its, key, frames[:2], record, seen[0])
            state, rest = jaxpf.run(its, key, frames[2:], record, seen[1], state)
            found = jax.tree.map(lambda *x: jnp.concatenate(x), found, rest)
        else:
            state, found = jaxpf.run(its, key, frames, record, observed)
        ahead = None
        if "forecast" in config:
            ahead = jaxpf.forecast(its, key, state, 1, record)[1][1]
        return jnp.exp(jnp.sum(found[0])), (found, ahead)

    return run


def of_filter(config):
    """z-scores of evidence, means, second moments and labels in the last frame."""
    made, (frames, observed) = tracker_of(config), frames_of(config)
    keys = jax.random.split(jax.random.key(1), RUNS)
    run, slopes, ahead = one_run(config, made), None, None
    if {"stop gradient", "score"} & set(config):
        of_run = jax.value_and_grad(run, has_aux=True)
        (_, (found, ahead)), slopes = mapped(partial(of_run, jnp.ones(2)), keys)
    elif {"resume", "forecast", "transforms"} & set(config):
        found, ahead = mapped(partial(run, None), keys)[1]
    else:
        given = iter(frames) if "chunks" in config else frames
        call = jaxpf.monte_carlo if "chunks" in config else monte_carlo_once
        found = call(made, keys, given, record=record, batch_size=500, observed=observed)
    if "stream" in config:
        frames_seen = jaxpf.stream(made, keys[0], iter(frames), observed=observed)
        for one, each in zip(itertools.count(), frames_seen):
            its = each.summary
            np.testing.assert_allclose(its.log_evidence, found[0][0, one], rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(its.estimate, found[1][0, one], rtol=1e-6, atol=1e-9)
    ratio = np.exp(np.sum(found[0], axis=1) - truth_of(config))
    scores = [z_scores(ratio, 1)]
    if slopes is not None:
        steps = 1e-5 * np.eye(2)
        expected = [(truth_of(config, 1 + s) - truth_of(config, 1 - s)) / 2e-5 for s in steps]
        scores += [z_scores(slopes * np.exp(-truth_of(config)), np.array(expected))]
    if not {"labelled", "side by side"} & set(config):  # runs' means are not weighted together
        _, mean, variance = exact(config)
        ratio, estimate, spread = ratio[:, None, None], found[1][:, -1], found[2][:, -1]
        second = variance[T - 1] + mean[T - 1] ** 2
        scores += [z_scores(ratio * estimate, mean[T - 1])]
        scores += [z_scores(ratio * (spread**2 + estimate**2), second)]
        if ahead is not None:
            scores += [z_scores(ratio * ahead[:, 0], mean[T])]
        if found[3] is not None:
            moves = np.linalg.matrix_power(FLIP, T if "moving labels" in config else 0)
            scores += [z_scores(ratio[..., 0] * found[3][:, -1], START_LABEL @ moves)]
    return np.concatenate(scores)


def mapped(function, keys):
    return jax.jit(lambda keys: jax.lax.map(function, keys, batch_size=500))(keys)


def truth_of(config, factors=(1.0, 1.0)):
    """Log of what the evidence estimates: of the labelled filter a mixture of targets."""
    if "labelled" not in config:
        return exact(config, factors)[0]
    return np.log(np.mean([np.exp(exact(config, factors, [part])[0]) for part in range(P)]))


#: For programs that take longer to run than to compile.
jit = partial(jax.jit, compiler_options=COMPILER_OPTIONS)


def of_smoothing(config):
    """Means over trajectories, times the evidence: without it they are biased by 1 / N."""
    frames, observed = frames_of(config)
    made, keys = tracker_of(config, 300), jax.random.split(jax.random.key(3), 200)
    lag = 2 if "lag" in config else None

    def smoothed(key):
        found = jaxpf.smooth(made, key, frames, 100, lag=lag, observed=observed)
        ratio = jnp.exp(jnp.sum(found.summaries.log_evidence) - truth_of(config))
        return ratio * found.estimate, ratio * (found.estimate**2 + found.spread**2)

    if lag is None:
        found = jit(lambda keys: jax.lax.map(smoothed, keys))(keys)
    else:
        found = [np.stack(x) for x in zip(*(smoothed(key) for key in keys[:30]), strict=True)]
    mean, variance = (x[:T] for x in exact(config)[1:])
    return np.concatenate([z_scores(found[0], mean), z_scores(found[1], variance + mean**2)])


def of_gibbs(config):
    made, (frames, observed) = tracker_of(config), frames_of(config)

    def last(key):
        return smoothing.particle_gibbs(made, key, frames, 30, observed=observed)[-1, 1:]

    found = np.asarray(jit(jax.vmap(last))(jax.random.split(jax.random.key(4), 500)))
    mean, variance = (x[:T] for x in exact(config)[1:])
    return np.concatenate([z_scores(found, mean), z_scores(found**2, variance + mean**2)])


def of_pmmh(config):
    """In a chain of a parameter without effect the mean of Z / Z^ is 1."""
    frames, observed = frames_of(config)
    made = tracker_of(config)
    few = {"num_draws": 1, "num_warmup": 60, "num_chains": 1000, "num_particles": N}
    drawn = jaxpf.pmmh(
        lambda p: made, lambda p: -0.5 * p**2, jax.random.key(6), frames, 0.1,
        observed=observed, **few,
    )  # fmt: skip
    return z_scores(np.exp(truth_of(config) - np.asarray(drawn.log_evidence)[:, 0]), 1)


USES = {
    "smoothing": of_smoothing,
    "lag": of_smoothing,
    "particle Gibbs": of_gibbs,
    "pmmh": of_pmmh,
}


def proof(config):
    """The z-scores of what a configuration promises."""
    return next((USES[level] for level in config if level in USES), of_filter)(config)


ARRAY = list(covering_array())


@pytest.mark.parametrize("config", ARRAY, ids=shown)
def test_what_is_combined_is_right(config):
    worst = np.nan_to_num(proof(config), nan=np.inf).max()
    assert worst < LIMIT, f"{shown(config)}: |z| = {worst:.1f}"


#: Pairs in which one lacks a field or method that the other reads.
REFUSED_BY_PYTHON = {
    ("coupled", "joint weighting"): AttributeError,
    ("error bars", "eskil"): AttributeError,
    ("error bars", "labelled"): AttributeError,
    ("error bars", "pffl"): AttributeError,
    ("error bars", "pmmh"): TypeError,
    ("pmmh", "side by side"): TypeError,
}


def test_what_is_not_combined_is_refused():
    for pair in map(sorted, PAIRS_REFUSED):
        with pytest.raises(REFUSED_BY_PYTHON.get(tuple(pair), InputError)):
            print(f"{pair} is not refused: |z| = {proof(default_with(*pair)).max()}")
