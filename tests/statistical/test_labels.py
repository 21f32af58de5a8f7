"""Labels that move: exact on a small grid, where they depend on substates, for every ordering.

Two targets step on the integers 0 to 4.  A label says which joint likelihood holds; it flips only
where the targets are apart.  The exact answer is a forward recursion over 5 x 5 x 2 states.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from places_in_a_row import PLACES, ReadFromTables, StepsInARow, one_step
from records import z_score

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass
from jaxpf.contract.calls import changed_inside

FRAMES, N, RUNS, FLIP = 3, 12, 20_000, 0.1
START, START_LABEL = (1, 3), (0.7, 0.3)
LIMIT = 4.5
RNG = np.random.default_rng(0)
#: log g_p(x) of every frame, and the log joint likelihood of places and label.
WEIGHTING = RNG.normal(size=(FRAMES, 2, PLACES))
JOINT = WEIGHTING[:, 0, :, None, None] + WEIGHTING[:, 1, None, :, None]
JOINT = JOINT + 1.5 * RNG.normal(size=(FRAMES, PLACES, PLACES, 2))


@pytree_dataclass
class Steps(StepsInARow):
    """A step left, none, or right, the ends holding."""

    flip: float = FLIP

    def predict(self, partition, current, previous):
        return current

    def propagate_label(self, key, label, substates):
        apart = substates[0, 0] != substates[1, 0]
        return jnp.where(apart & (jax.random.uniform(key) < self.flip), 1 - label, label)


@pytree_dataclass
class Tables(ReadFromTables):
    """Likelihoods read from tables; a frame is its weighting and joint ones."""

    def log_joint_labelled(self, observation, substates, log_probs, label):
        a, b = substates[:, 0].astype(int)
        return observation[1][a, b, label]


@pytree_dataclass
class OfSingleTargets:
    """The weighting likelihoods alone."""

    def observe(self, frame):
        return frame[0]

    def log_prob(self, observation, partition, substate):
        return observation[partition, substate[0].astype(int)]


def exact():
    """Evidence, and the posterior ``[5, 5, 2]`` in the last frame."""
    step = one_step()
    belief = np.zeros((PLACES, PLACES, 2))
    belief[START] = START_LABEL
    apart = ~np.eye(PLACES, dtype=bool)[..., None] * FLIP
    for joint in JOINT:
        moved = np.einsum("abl,ac,bd->cdl", belief, step, step)
        belief = ((1 - apart) * moved + apart * moved[..., ::-1]) * np.exp(joint)
    return belief.sum(), belief / belief.sum()


ORDERINGS = {
    "sir": ordering.sir(2),
    "ps": ordering.ps([0, 1]),
    "dps": ordering.dps(2),
    "branched": ordering.branched([[0, 1], [1, 0]]),
}


def tracker(chosen, likelihood=None, **options):
    return jaxpf.Partitioned(
        dynamics=Steps(),
        likelihood=Tables() if likelihood is None else likelihood,
        ordering=chosen,
        initial=np.array(START, np.float32)[:, None],
        initial_label=np.array(START_LABEL),
        num_particles=N,
        **{"resampling": "multinomial", **options},
    )


def report(state, summary):
    return summary.log_evidence, summary.estimate[:, 0], summary.label_probabilities


def runs(chosen, **options):
    keys = jax.random.split(jax.random.key(5), RUNS)
    frames = jnp.asarray(WEIGHTING), jnp.asarray(JOINT)
    found = jaxpf.monte_carlo(tracker(chosen, **options), keys, frames, report, batch_size=2000)
    return [np.asarray(values, float) for values in found]


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.always) for n in ("ps", "branched")] + ["sir", "dps"],
)
def test_evidence_places_and_labels_are_unbiased(name):
    evidence, posterior = exact()
    log_evidence, places, labels = runs(ORDERINGS[name])
    scale = np.exp(log_evidence.sum(axis=1)) / evidence
    assert z_score(scale, 1) < LIMIT
    grid = np.arange(PLACES)
    truth = np.array([posterior.sum(axis=(1, 2)) @ grid, posterior.sum(axis=(0, 2)) @ grid])
    assert (z_score(scale[:, None] * places[:, -1], truth) < LIMIT).all()
    assert (z_score(scale[:, None] * labels[:, -1], posterior.sum(axis=(0, 1))) < LIMIT).all()
    np.testing.assert_allclose(labels.sum(axis=-1), 1, rtol=1e-5)


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("ps", {"ess_threshold": 0.6, "tempering": 0.7}),
        ("branched", {"joint_weighting": True}),
        ("ps", {"joint_weighting": True}),
    ],
)
def test_labels_are_carried_through_other_selections(name, options):
    evidence, posterior = exact()
    log_evidence, _, labels = runs(ORDERINGS[name], **options)
    scale = np.exp(log_evidence.sum(axis=1)) / evidence
    assert z_score(scale, 1) < LIMIT
    assert (z_score(scale[:, None] * labels[:, -1], posterior.sum(axis=(0, 1))) < LIMIT).all()


@pytree_dataclass
class Meeting(Steps):
    """Labels say whether the targets have met."""

    def propagate_label(self, key, label, substates):
        return jnp.where(substates[0, 0] == substates[1, 0], 1, label)


def report_distance(state, summary):
    """Evidence, and the mean distance of targets that have met."""
    a, b = state.lagged[0, 0]
    return summary.log_evidence, jnp.exp(state.log_weights) @ (state.label * jnp.abs(a - b))


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("name", ["ps", "sps"])
def test_exchange_separates_places_from_the_label_that_depends_on_them(name):
    """The evidence agrees all the same, so exchange is refused."""
    step, belief, same = one_step(), np.zeros((PLACES, PLACES, 2)), np.arange(PLACES)
    belief[START] = START_LABEL
    for weighting in WEIGHTING:
        belief = np.einsum("abl,ac,bd->cdl", belief, step, step)
        belief[same, same] = belief[same, same].sum(axis=-1, keepdims=True) * [0, 1]
        belief *= np.exp(weighting[0][:, None, None] + weighting[1][None, :, None])
    distance = np.abs(same[:, None] - same) * belief[..., 1] / belief.sum()
    made = dataclasses.replace(tracker(ORDERINGS["ps"], OfSingleTargets()), dynamics=Meeting())
    if name == "sps":
        swapped = ordering.sps(num_partitions=2)
        with pytest.raises(InputError, match="swap='combinatorial' separates a particle's parts"):
            dataclasses.replace(made, ordering=swapped)
        made = changed_inside(made, "ordering", lambda _: swapped)
    keys = jax.random.split(jax.random.key(5), RUNS)
    frames = jnp.asarray(WEIGHTING), jnp.asarray(JOINT)
    found = jaxpf.monte_carlo(made, keys, frames, report_distance, batch_size=2000)
    log_evidence, mean = (np.asarray(values, float) for values in found)
    scale = np.exp(log_evidence.sum(axis=1)) / belief.sum()
    assert z_score(scale, 1) < LIMIT
    worst = z_score(scale * mean[:, -1], distance.sum())
    assert (worst < LIMIT) if name == "ps" else worst > 10, worst
