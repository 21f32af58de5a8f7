"""Features by features: configurations that cover all pairs, each right or refused.

A configuration takes one level of every factor; the covering array holds every pair of levels but
those of ``REFUSED``, each of which is refused in one sentence.  The model is linear and Gaussian,
so that evidence, means and second moments are known: a run is right if they are unbiased.
"""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass, smoothing, tuning
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
        dynamics = (CoupledWithLabels if has_labels else Coupled)(noise)
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


def runs(config):
    """What ``record`` keeps of many runs ``[R, T, ...]``, by the configuration's way to run."""
    made, (frames, observed) = tracker_of(config), frames_of(config)
    keys = jax.random.split(jax.random.key(1), RUNS)

    @jax.jit
    def in_parts(keys):
        def run(key):
            its_observed = (None, None) if observed is None else (observed[:2], observed[2:])
            state, first = jaxpf.run(made, key, frames[:2], record, its_observed[0])
            rest = jaxpf.run(made, key, frames[2:], record, its_observed[1], state, time=2)[1]
            return jax.tree.map(lambda *x: jnp.concatenate(x), first, rest)

        return jax.lax.map(run, keys, batch_size=500)

    @jax.jit
    def by_hand(keys):
        return jax.vmap(lambda key: jaxpf.run(made, key, frames, record, observed)[1])(keys)

    if "transforms" in config:
        return by_hand(keys)
    if "resume" in config:
        return in_parts(keys)
    given = iter(frames) if "chunks" in config else frames
    found = jaxpf.monte_carlo(made, keys, given, record, batch_size=500, observed=observed)
    if "stream" in config:
        streamed = [
            (summary.log_evidence, summary.estimate)
            for summary in jaxpf.stream(made, keys[0], iter(frames), observed=observed)
        ]
        for one, other in zip(zip(*streamed, strict=True), found[:2], strict=True):
            np.testing.assert_allclose(np.stack(one), other[0], rtol=1e-6, atol=1e-9)
    return found


def of_filter(config):
    """z-scores of evidence, means, second moments and labels in the last frame."""
    log_evidence, estimate, spread, label = runs(config)
    if "labelled" in config:  # a mixture of targets
        every = [exact(config, parts=[part])[0] for part in range(P)]
        return z_scores(np.exp(np.sum(log_evidence, axis=1)) / np.mean(np.exp(every)), 1)
    truth, mean, variance = exact(config)
    ratio = np.exp(np.sum(log_evidence, axis=1) - truth)
    scores = [z_scores(ratio, 1)]
    if "side by side" not in config:  # whose mean is not weighted by the runs' evidence
        ratio, estimate, spread = ratio[:, None, None], estimate[:, -1], spread[:, -1]
        mean, variance = mean[T - 1], variance[T - 1]
        scores += [z_scores(ratio * estimate, mean)]
        scores += [z_scores(ratio * (spread**2 + estimate**2), variance + mean**2)]
        if label is not None:
            moves = np.linalg.matrix_power(FLIP, T if "moving labels" in config else 0)
            scores += [z_scores(ratio[:, 0] * label[:, -1], START_LABEL @ moves)]
    return np.concatenate(scores)


def of_gradient(config):
    """z-scores of the evidence's derivative by the noises of motion and observation."""
    made, (frames, observed) = tracker_of(config), frames_of(config)

    def evidence(factors, key):
        model = model_of(config, factors)
        changed = made
        for name in ("dynamics", "likelihood"):
            changed = jaxpf.contract.changed_inside(changed, name, lambda _, name=name: model[name])
        _, (log_evidence, *_) = jaxpf.run(changed, key, frames, record, observed)
        return jnp.exp(jnp.sum(log_evidence))

    def truth(factors):
        if "labelled" in config:
            return np.mean([np.exp(exact(config, factors, [part])[0]) for part in range(P)])
        return np.exp(exact(config, factors)[0])

    keys = jax.random.split(jax.random.key(2), RUNS)
    slope = jax.jit(
        lambda keys: jax.lax.map(lambda k: jax.grad(evidence)(jnp.ones(2), k), keys, batch_size=500)
    )
    steps = 1e-5 * np.eye(2)
    expected = np.array([(truth(1 + s) - truth(1 - s)) / 2e-5 for s in steps])
    return z_scores(slope(keys), expected)


def of_smoothing(config):
    frames, observed = frames_of(config)
    made, keys = tracker_of(config, 300), jax.random.split(jax.random.key(3), 60)
    lag = 2 if "lag" in config else None

    def smoothed(key):
        found = jaxpf.smooth(made, key, frames, 100, lag=lag, observed=observed)
        return found.estimate, found.estimate**2 + found.spread**2

    if lag is None:
        found = jax.jit(lambda keys: jax.lax.map(smoothed, keys))(keys)
    else:
        found = [np.stack(x) for x in zip(*(smoothed(key) for key in keys[:30]), strict=True)]
    mean, variance = (x[:T] for x in exact(config)[1:])
    return np.concatenate([z_scores(found[0], mean), z_scores(found[1], variance + mean**2)])


def of_gibbs(config):
    made, (frames, observed) = tracker_of(config), frames_of(config)

    def last(key):
        return smoothing.particle_gibbs(made, key, frames, 6, observed=observed)[-1, 1:]

    smoothing.gibbs.check_conditional(made)
    found = np.asarray(jax.jit(jax.vmap(last))(jax.random.split(jax.random.key(4), 500)))
    mean, variance = (x[:T] for x in exact(config)[1:])
    return np.concatenate([z_scores(found, mean), z_scores(found**2, variance + mean**2)])


def of_forecast(config):
    made, (frames, observed) = tracker_of(config), frames_of(config)

    def ahead(key):
        state, (log_evidence, *_) = jaxpf.run(made, key, frames, record, observed)
        _, (_, estimate, _, _) = jaxpf.forecast(made, key, state, 1, record, time=T)
        return jnp.sum(log_evidence), estimate[-1]

    keys = jax.random.split(jax.random.key(5), RUNS)
    log_evidence, estimate = jax.jit(lambda keys: jax.lax.map(ahead, keys, batch_size=500))(keys)
    if {"labelled", "side by side"} & set(config):
        return np.where(np.isfinite(estimate).all(), [0.0], [np.inf])
    truth, mean, _ = exact(config)
    ratio = np.exp(np.asarray(log_evidence) - truth)
    return z_scores(ratio[:, None, None] * estimate, mean[T])


def of_pmmh(config):
    """In a chain of a parameter without effect the mean of Z / Z^ is 1."""
    frames, observed = frames_of(config)
    made = tracker_of(config)
    few = {"num_draws": 1, "num_warmup": 12, "num_chains": 1000, "num_particles": N}
    drawn = jaxpf.pmmh(
        lambda p: made, lambda p: -0.5 * p**2, jax.random.key(6), frames, 0.1,
        observed=observed, **few,
    )  # fmt: skip
    if "labelled" in config:
        every = [exact(config, parts=[part])[0] for part in range(P)]
        truth = np.log(np.mean(np.exp(every)))
    else:
        truth = exact(config)[0]
    return z_scores(np.exp(truth - np.asarray(drawn.log_evidence)[:, 0]), 1)


USES = {
    "smoothing": of_smoothing,
    "lag": of_smoothing,
    "particle Gibbs": of_gibbs,
    "forecast": of_forecast,
    "pmmh": of_pmmh,
}


def proofs(config):
    """The z-scores of everything that a configuration promises."""
    yield from (of_use(config) for level, of_use in USES.items() if level in config)
    yield of_filter(config)
    if {"stop gradient", "score"} & set(config):
        yield of_gradient(config)


def default_with(*levels):
    others = [x[0] for name, x in FACTORS.items() if name not in map(FACTOR.get, levels)]
    return tuple(sorted([*levels, *others], key=list(FACTOR).index))


ARRAY = list(covering_array())


def shown(config):
    return ", ".join(x for x in config if x != FACTORS[FACTOR[x]][0]) or "defaults"


@pytest.mark.parametrize("config", ARRAY, ids=shown)
@pytest.mark.usefixtures("compiled_quickly")
def test_what_is_combined_is_right(config):
    worst = max(np.nan_to_num(z, nan=np.inf).max() for z in proofs(config))
    assert worst < LIMIT, f"{shown(config)}: |z| = {worst:.1f}"


def test_what_is_not_combined_is_refused():
    for pair in PAIRS_REFUSED:
        with pytest.raises(InputError):
            next(proofs(default_with(*pair)))
            pytest.fail(f"{sorted(pair)} is not refused")
