"""Every function that takes frames takes their inputs, and which of them were observed.

States follow their inputs up to a thousandth, so that evidence and states are known.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import norm

import jaxpf
from jaxpf import smoothing, tuning
from jaxpf.running.runs import with_rows

T, KEY, KEYS = 5, jax.random.key(0), jax.random.split(jax.random.key(1), 2)
INPUTS = {"push": np.float32([[2, -4], [8, 0], [-6, 9], [4, 3], [1, -2]]), "noise": np.r_[1.0:6.0]}
STATES = 0.5 * INPUTS["push"]
Y = STATES + np.float32([[0.3, -0.2], [0.5, 0.4], [-0.6, 0.1], [0.2, 0.7], [-0.1, -0.4]])
#: Which frames, and which numbers of them, of which one frame lacks all.
OBSERVED = {
    "frames": np.array([True, False, True, True, False]),
    "numbers": np.array([[1, 1], [0, 1], [0, 0], [1, 0], [1, 1]], bool),
}


def transition(key, x, p, u):
    return p * u["push"] + 1e-3 * jax.random.normal(key, (2,))


def density(new, x, p, u):
    return norm.logpdf(new, p * u["push"], 1e-3).sum()


def log_likelihood(y, x, p, u):
    seen = ~jnp.isnan(y)
    scores = norm.logpdf(jnp.where(seen, y, 0.0), x, u["noise"])
    return jnp.sum(jnp.where(seen, scores, 0.0))


log_likelihood.handles_nan = True
MODEL = jaxpf.state_space(
    initial=np.zeros(2, np.float32),
    transition=transition,
    transition_log_density=density,
    log_likelihood=log_likelihood,
    parameters=0.5,
    num_particles=4,
    resampling="multinomial",
)


def increments(seen):
    """Exact log evidence of every frame, given which numbers were seen, ``[T, 2]``."""
    scores = norm.logpdf(Y, STATES, INPUTS["noise"][:, None])
    return np.where(seen, scores, 0.0).sum(axis=1)


def total(seen):
    return increments(seen).sum()


def states(seen):
    return STATES


def increments_and_states(seen):
    return np.c_[increments(seen), STATES]


def of_summaries(summaries, estimate=None):
    estimate = summaries.estimate if estimate is None else estimate
    return np.c_[summaries.log_evidence, np.asarray(estimate)[..., 0, :]]


def streamed(frames):
    """What comes frame by frame, as arrays."""
    values = [
        (frame.summary, getattr(frame, "estimate", frame.summary.estimate)) for frame in frames
    ]
    return of_summaries(*jax.tree.map(lambda *x: np.stack(x), *values))


def smoothed(frames, **options):
    found = jaxpf.smooth(MODEL, KEY, frames, **options)
    return of_summaries(found.summaries, found.estimate)


def build(p):
    """The same model for all parameters."""
    return MODEL


def by_pmmh(frames, **options):
    few = {"num_draws": 1, "num_warmup": 1, "num_chains": 1, "num_particles": 4}
    return jaxpf.pmmh(build, norm.logpdf, KEY, frames, 0.5, **few, **options).log_evidence[0, 0]


def by_smc2(frames, **options):
    few = {"num_draws": 2, "num_moves": 1}
    start = jax.random.normal
    return tuning.smc2(build, norm.logpdf, start, KEY, frames, **few, **options).log_evidence


def tuned(objective, factor):
    """The loss before the first step."""

    def first_loss(frames, **options):
        labels = STATES[:, None] + np.float32([3, 4])
        sequence = tuning.TrainingSequence(MODEL, frames, labels, **options)
        settings = tuning.Settings(steps=1, repeats=1, runs=2)
        found = jaxpf.tune(sequence, ["parameters"], objective=objective, settings=settings)
        return factor * found.descents[0].loss[0]

    return first_loss


def own_objective(tracker, keys, frames):
    return jaxpf.monte_carlo(tracker, keys, frames).log_evidence.sum(axis=1)


def objective(function, *labels):
    return lambda y, **options: function(MODEL, KEYS, y, *labels, **options)


def one_by_one(y, observed=None, **options):
    """With ``inputs`` one by one, too."""
    rows = [jax.tree.map(lambda x, t=t: x[t], INPUTS) for t in range(T)]
    given = None if observed is None else iter(observed)
    return streamed(jaxpf.stream(MODEL, KEY, iter(y), given, inputs=iter(rows)))


def many_one_by_one(y, observed=None, inputs=None):
    """With inputs of all frames, which are given before."""
    its = with_rows(MODEL, inputs, len(y))
    given = None if observed is None else iter(observed)
    return jaxpf.monte_carlo(its, KEYS, iter(y), observed=given).log_evidence


#: Function of frames, ``observed`` and ``inputs``, and what it must return.
DOORS = {
    "run": (
        lambda y, **options: of_summaries(jaxpf.run(MODEL, KEY, y, **options)[1]),
        increments_and_states,
    ),
    "monte_carlo": (
        lambda y, **options: jaxpf.monte_carlo(MODEL, KEYS, y, **options).log_evidence,
        lambda seen: np.stack([increments(seen)] * 2),
    ),
    "monte_carlo, one by one": (many_one_by_one, lambda seen: np.stack([increments(seen)] * 2)),
    "stream": (
        lambda y, **options: streamed(jaxpf.stream(MODEL, KEY, y, **options)),
        increments_and_states,
    ),
    "stream, one by one": (one_by_one, increments_and_states),
    "smooth": (smoothed, increments_and_states),
    "smooth by genealogy": (
        lambda y, **options: smoothed(y, method="genealogy", **options),
        increments_and_states,
    ),
    "smooth with a lag": (
        lambda y, **options: smoothed(y, lag=2, **options),
        increments_and_states,
    ),
    "smoothing.smooth_stream": (
        lambda y, **options: streamed(smoothing.smooth_stream(MODEL, KEY, y, 2, **options)),
        increments_and_states,
    ),
    "particle_gibbs": (
        lambda y, **options: smoothing.particle_gibbs(MODEL, KEY, y, 1, **options)[0, 1:, 0],
        states,
    ),
    "pmmh": (by_pmmh, total),
    "smc2": (by_smc2, increments),
    "tune": (tuned("evidence", -T), total),
    "tune by an objective of one's own": (tuned(own_objective, 1.0), total),
    "tune by positions": (tuned("position", 1.0), lambda seen: 5.0),
    "log_evidence": (objective(tuning.log_evidence), total),
    "position_error": (
        objective(tuning.position_error, STATES[:, None] + np.float32([3, 4])), lambda seen: 5.0,
    ),
    "crps": (objective(tuning.crps_loss, STATES[:, None] + np.float32([3, 4])), lambda seen: 3.5),
}  # fmt: skip


#: Of those that go through the same function underneath one is quick.
QUICK = {"run", "monte_carlo", "stream", "smooth", "pmmh", "tune"}


@pytest.mark.parametrize(
    ("door", "kind"),
    [
        pytest.param(door, kind, marks=[pytest.mark.slow] * (door not in QUICK or kind == "frames"))
        for door in DOORS
        for kind in OBSERVED
    ],
)
def test_inputs_and_what_was_observed_pass_through(door, kind):
    """What was not observed, or is masked, holds a number that would change the result."""
    (call, exact), observed = DOORS[door], OBSERVED[kind]
    seen = np.broadcast_to(observed.reshape(T, -1), Y.shape)
    frames = np.where(seen, Y, np.float32(1e4))
    found = call(frames, observed=observed, inputs=INPUTS)
    np.testing.assert_allclose(found, np.broadcast_to(exact(seen), np.shape(found)), atol=0.01)
    same = call(np.ma.masked_array(frames, ~seen), inputs=INPUTS)
    np.testing.assert_allclose(found, same, rtol=1e-5)
