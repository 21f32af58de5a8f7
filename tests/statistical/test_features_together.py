"""Features by features: configurations that cover all pairs, each right or refused.

A configuration takes one level of every factor; the covering array holds every pair of levels but
those of ``REFUSED``, each of which is refused in one sentence.  The model is linear and Gaussian,
so that evidence, means and second moments are known: a run is right if they are unbiased.
Smoothing, particle Gibbs and pmmh run frames by themselves, whichever the way to run.
"""

import dataclasses
import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import COMPILER_OPTIONS, LIMIT

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass, smoothing
from jaxpf.contract import CoupledDynamics, Proposal
from jaxpf.dynamics import IndependentGaussian, LinearGaussian
from jaxpf.filters import Relocation, SideBySide, WithErrorBars
from jaxpf.gradients import StopGradient
from jaxpf.likelihoods import Gaussian

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

T, P, D, N, RUNS = 3, 3, 2, 24, 3000
FLAT, TREE = (-1, -1, -1), (-1, 0, 0)
#: The first level of each factor is what a user gets without asking.
FACTORS = {
    "filter": ("ps", "sir", "dps", "sps", "branched", "labelled", "pffl", "eskil"),
    "model": ("flat", "tree", "second order", "coupled", "time-varying"),
    "likelihood": ("factors", "joint", "joint weighting"),
    "labels": ("no labels", "labels", "moving labels"),
    "motion": ("dynamics", "proposal", "relocation"),
    "selection": ("always", "adaptive", "tempering"),
    "gradient": ("no gradient", "stop gradient", "score"),
    "frames": ("all frames", "missing frame", "missing partition"),
    "wrapper": ("bare", "error bars", "side by side"),
    "run": ("run", "transforms", "chunks", "stream", "resume"),
    "use": ("filtering", "smoothing", "lag", "particle Gibbs", "forecast", "pmmh"),
}
FACTOR = {level: name for name, levels in FACTORS.items() for level in levels}
#: A level, and those that are refused with it.
REFUSED = {
    "dps": {"tree", "particle Gibbs"},
    "sps": {"coupled", "joint", "joint weighting", "moving labels", "tempering", "particle Gibbs"},
    "branched": {"particle Gibbs"},
    "tree": {"joint weighting", "relocation", "labelled", "pffl", "eskil"},
    "coupled": {
        *("joint weighting", "proposal", "relocation", "score"),
        *("smoothing", "lag", "particle Gibbs", "labelled", "pffl", "eskil"),
    },
    "joint": {"relocation", "labelled", "pffl", "eskil"},
    "joint weighting": {
        *("relocation", "score", "particle Gibbs", "labelled", "pffl", "eskil"),
    },
    "labels": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "moving labels": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "proposal": {"labelled", "pffl", "eskil"},
    "relocation": {
        *("stop gradient", "score", "smoothing", "lag", "particle Gibbs", "pffl", "eskil"),
    },
    "adaptive": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "tempering": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "stop gradient": {"pffl", "eskil"},
    "score": {"pffl", "eskil"},
    "missing partition": {"labelled"},
    "error bars": {
        *("smoothing", "lag", "particle Gibbs", "pmmh", "labelled", "pffl", "eskil"),
    },
    "side by side": {"smoothing", "lag", "particle Gibbs", "pmmh"},
    "smoothing": {"labelled", "pffl", "eskil"},
    "lag": {"labelled", "pffl", "eskil"},
    "particle Gibbs": {"labelled", "pffl", "eskil"},
}
PAIRS_REFUSED = {frozenset((one, other)) for one, others in REFUSED.items() for other in others}


def allowed(levels):
    return not any(frozenset(pair) in PAIRS_REFUSED for pair in itertools.combinations(levels, 2))


def covering_array():
    """Configurations, greedily: each takes the levels that cover most pairs that are left."""
    rng = np.random.default_rng(0)
    every = itertools.combinations(FACTORS, 2)
    left = {
        frozenset(pair)
        for one, other in every
        for pair in itertools.product(FACTORS[one], FACTORS[other])
        if allowed(pair)
    }
    while left:
        best: tuple[int, tuple[str, ...]] = 0, ()
        ordered = sorted(map(sorted, left))
        for _ in range(30):
            chosen = list(ordered[rng.integers(len(left))])
            others = [name for name in FACTORS if name not in map(FACTOR.get, chosen)]
            for name in rng.permutation(others):
                levels = [x for x in FACTORS[name] if allowed([*chosen, x])]
                gains = [sum(frozenset((x, y)) in left for y in chosen) for x in levels]
                chosen.append(levels[int(np.argmax(gains))])
            pairs = {frozenset(pair) for pair in itertools.combinations(chosen, 2)} & left
            best = max(best, (len(pairs), tuple(sorted(chosen, key=list(FACTOR).index))))
        left -= {frozenset(pair) for pair in itertools.combinations(best[1], 2)}
        yield best[1]


class MovesLabels:
    """Labels, 0 and 1, that change three times in ten."""

    def propagate_label(self, key, label, substates):
        return jnp.where(jax.random.uniform(key) < 0.3, 1 - label, label)

    def log_label(self, new, label, substates):
        return jnp.log(jnp.where(new == label, 0.7, 0.3))


@pytree_dataclass
class Coupled(CoupledDynamics):
    """Each object is drawn towards the next one."""

    noise: jax.Array

    def propagate(self, key, partition, current, previous, parent, others):
        moved = 0.6 * current + 0.2 * others[(partition + 1) % P]
        return moved + self.noise[partition, 0, 0] * jax.random.normal(key, current.shape)


@pytree_dataclass
class Varying:
    """Dynamics whose transition changes with time."""

    dynamics: LinearGaussian

    def at_frame(self, time):
        scale = jnp.asarray(PACE)[jnp.minimum(time, T)]
        its = self.dynamics
        return dataclasses.replace(its, transition=its.transition * scale)


@pytree_dataclass
class LinearWithLabels(MovesLabels, LinearGaussian):
    """Linear motion, and labels."""


@pytree_dataclass
class CoupledWithLabels(MovesLabels, Coupled):
    """Coupled motion, and labels."""


@pytree_dataclass
class Guess(Proposal):
    """Beside the dynamics, and wider."""

    scale: float = 1.5

    def propose(self, key, observation, partition, current, previous, parent):
        return 0.8 * current + 0.3 + self.scale * jax.random.normal(key, current.shape)

    def log_density(self, observation, partition, new, current, previous, parent):
        normal = jax.scipy.stats.norm.logpdf(new, 0.8 * current + 0.3, self.scale)
        return jnp.sum(normal)


@pytree_dataclass
class Sure(Gaussian):
    """Gaussian noise; objects are never lost, so that none jumps."""

    def log_odds(self, observation, partition, substate):
        return jnp.asarray(20.0, substate.dtype)


@pytree_dataclass
class Joint(Sure):
    """Noise that is correlated between partitions; each alone is weighed by its own."""

    def log_joint(self, observation, substates, log_probs, observed=None):
        seen = jnp.ones(P, bool) if observed is None else observed
        covariance = (
            jnp.where(seen[:, None] & seen, CORRELATED, jnp.eye(P)) * self.noise[0, 0, 0] ** 2
        )
        residual = jnp.where(seen[:, None], observation - substates, 0.0)
        log_normal = jax.vmap(jax.scipy.stats.multivariate_normal.logpdf, (1, None, None))
        unseen = (~seen).sum() * D * jnp.log(jnp.sqrt(2 * jnp.pi) * self.noise[0, 0, 0])
        return log_normal(residual, jnp.zeros(P), covariance).sum() + unseen


CORRELATED = 0.5 * np.eye(P) + 0.5
PACE = np.array([1.0, 0.4, 1.2, 0.7])
OBSERVED = np.ones((T, P), bool)
OBSERVED[1, 0] = False
FLIP = np.array([[0.7, 0.3], [0.3, 0.7]])
START_LABEL = np.array([0.2, 0.8])


def frames_of(config):
    frames = 1.5 * np.random.default_rng(0).normal(size=(T, P, D))
    if "missing frame" in config:
        frames[1] = np.nan
    return frames, OBSERVED if "missing partition" in config else None


def coefficients(config):
    """Transition, lag, coupling to the parent, and to the next object."""
    return (
        0.6 if {"second order", "coupled"} & set(config) else 0.8,
        0.3 if "second order" in config else 0.0,
        0.5 if "tree" in config else 0.0,
        0.2 if "coupled" in config else 0.0,
    )


def exact(config, factors=(1.0, 1.0), parts=range(P)):
    """Log evidence, and means and variances ``[T + 1, P, D]`` given all frames.

    ``factors`` multiply the noise of the motion and of the observations.
    """
    parts = list(parts)
    size = len(parts)
    own, lag, parental, next_one = coefficients(config)
    parents = np.zeros((size, size))
    for part, parent in enumerate(TREE if "tree" in config else ()):
        parents[part, max(parent, 0)] = parental * (parent >= 0)
    solve = np.linalg.inv(np.eye(size) - parents)
    noises = np.eye(size * (T + 2)).reshape(T + 2, size, -1)
    states = [noises[0], noises[0]]
    for t in range(T + 1):
        pace = PACE[t] if "time-varying" in config else 1.0
        matrix = own * pace * np.eye(size) + next_one * np.roll(np.eye(size), 1, axis=1)
        moved = matrix @ states[-1] + lag * states[-2] + factors[0] * noises[t + 1]
        states.append(solve @ moved)
    roots = np.concatenate(states[2:])  # [(T + 1) size, noises]
    frames, observed = frames_of(config)
    seen = np.isfinite(frames[..., 0]) & (True if observed is None else observed)
    joint = CORRELATED if {"joint", "joint weighting"} & set(config) else np.eye(P)
    noise = np.kron(np.eye(T), joint[np.ix_(parts, parts)]) * factors[1] ** 2
    seen = np.flatnonzero(seen[:, parts])
    prior = roots @ roots.T
    total = prior[np.ix_(seen, seen)] + noise[np.ix_(seen, seen)]
    y = frames[:, parts].reshape(-1, D)[seen]
    gain = prior[:, seen] @ np.linalg.inv(total)
    log_evidence = -0.5 * (
        np.sum(y * np.linalg.solve(total, y)) + D * np.linalg.slogdet(2 * np.pi * total)[1]
    )
    mean = (gain @ y).reshape(T + 1, size, D)
    variance = np.diagonal(prior - gain @ prior[seen]).reshape(T + 1, size, 1)
    return log_evidence, mean, variance


def model_of(config, factors=(1.0, 1.0)):
    own, lag, parental, _ = coefficients(config)
    blocks = np.broadcast_to(np.eye(D), (P, D, D))
    noise, seen_noise = factors[0] * blocks, factors[1] * blocks
    has_labels = "moving labels" in config
    if "coupled" in config:
        dynamics = (CoupledWithLabels if has_labels else Coupled)(jnp.asarray(noise))
    else:
        dynamics = (LinearWithLabels if has_labels else LinearGaussian)(
            own * blocks,
            noise,
            lag=lag * blocks if lag else None,
            coupling=parental * blocks if parental else None,
        )
    if "time-varying" in config:
        dynamics = Varying(dynamics)
    likelihood = (Joint if {"joint", "joint weighting"} & set(config) else Sure)(seen_noise)
    initial = IndependentGaussian(np.zeros((P, D)), 1.0)
    return {"dynamics": dynamics, "likelihood": likelihood, "initial": initial}


def tracker_of(config, num_particles=N):
    """The configuration's tracker; refuses as the library does."""
    config, model = set(config), model_of(config)
    settings = {"num_particles": num_particles, "resampling": "multinomial"}
    for level, name, value in (
        ("proposal", "proposal", Guess()),
        ("relocation", "relocation", Relocation(0.5, np.array([9.0, 9.0]), (2, 2))),
        ("adaptive", "ess_threshold", 0.6),
        ("tempering", "tempering", 0.7),
        ("stop gradient", "gradient", StopGradient()),
        ("score", "gradient", StopGradient()),
        ("score", "motion_gradient", "score"),
        ("joint weighting", "look_ahead", True),
        ("labels", "initial_label", START_LABEL),
        ("moving labels", "initial_label", START_LABEL),
        ("tree", "parents", TREE),
    ):
        if level in config:
            settings[name] = value
    parents = TREE if "tree" in config else FLAT
    orders = {
        "ps": lambda: ordering.ps([0, 2, 1]),
        "sir": lambda: ordering.sir(P),
        "dps": lambda: ordering.dps(P),
        "sps": lambda: ordering.sps(parents),
        "branched": lambda: ordering.branched([[0, 1, 2], [0, 2, 1]]),
    }
    others = {
        "labelled": lambda: jaxpf.Labelled(
            **model, **settings | {"weights": "corrected", "num_targets": P}
        ),
        "pffl": lambda: jaxpf.PFFL(**model, **settings),
        "eskil": lambda: jaxpf.Eskil(**model, shape="none", drift="clip", proper=True, **settings),
    }
    name = next(name for name in FACTORS["filter"] if name in config)
    if name in orders:
        made = jaxpf.Partitioned(**model, ordering=orders[name](), **settings)
    else:
        allowed = {"labelled": jaxpf.Labelled, "pffl": jaxpf.PFFL, "eskil": jaxpf.Eskil}[name]
        if unknown := settings.keys() - allowed.__dataclass_fields__.keys():
            raise InputError(f"{name} has no {sorted(unknown)}.")
        made = others[name]()
    if "error bars" in config:
        return WithErrorBars(made, lag=1)
    return SideBySide(made, 2) if "side by side" in config else made


def record(state, summary):
    return summary.log_evidence, summary.estimate, summary.spread, summary.label_probabilities


def z_scores(samples, expected):
    samples = np.asarray(samples)
    assert samples.dtype == np.float64
    error = samples.std(axis=0, ddof=1) / len(samples) ** 0.5
    return np.ravel(np.abs(samples.mean(axis=0) - expected) / error)


#: Programs are small, and compiled once.
jit = partial(jax.jit, compiler_options=COMPILER_OPTIONS)
monte_carlo = jit(jaxpf.monte_carlo, static_argnames=("record", "batch_size"))


def changed(config, made, factors):
    """The tracker with noises multiplied by ``factors``."""
    model = model_of(config, factors)
    for name in ("dynamics", "likelihood"):
        made = jaxpf.contract.changed_inside(made, name, lambda _, name=name: model[name])
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
        call = jaxpf.monte_carlo if "chunks" in config else monte_carlo
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
    return jit(lambda keys: jax.lax.map(function, keys, batch_size=500))(keys)


def truth_of(config, factors=(1.0, 1.0)):
    """Log of what the evidence estimates: of the labelled filter a mixture of targets."""
    if "labelled" not in config:
        return exact(config, factors)[0]
    return np.log(np.mean([np.exp(exact(config, factors, [part])[0]) for part in range(P)]))


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


def default_with(*levels):
    others = [x[0] for name, x in FACTORS.items() if name not in map(FACTOR.get, levels)]
    return tuple(sorted([*levels, *others], key=list(FACTOR).index))


ARRAY = list(covering_array())


def shown(config):
    return ", ".join(x for x in config if x != FACTORS[FACTOR[x]][0]) or "defaults"


@pytest.mark.parametrize("config", ARRAY, ids=shown)
@pytest.mark.usefixtures("compiled_quickly")
def test_what_is_combined_is_right(config):
    worst = np.nan_to_num(proof(config), nan=np.inf).max()
    assert worst < LIMIT, f"{shown(config)}: |z| = {worst:.1f}"


def test_what_is_not_combined_is_refused():
    for pair in map(sorted, PAIRS_REFUSED):
        with pytest.raises(InputError):
            print(f"{pair} is not refused: |z| = {proof(default_with(*pair)).max()}")
