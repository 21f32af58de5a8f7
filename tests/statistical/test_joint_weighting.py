"""Joint weighting: exact on a small grid, and worth it where targets exclude one another.

Three look-alikes step on the integers 0 to 4.  The exact answer is a forward recursion over
5 x 5 x 5 states.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import monte_carlo
from featured_trackers import MovesLabels
from places_in_a_row import PLACES, ReadFromTables, StepsInARow, one_step
from records import z_score

import jaxpf
from jaxpf import ordering, pytree_dataclass
from jaxpf.filters.partitioned import weighing

FRAMES, N, RUNS, LIMIT = 3, 12, 20_000, 4.5
#: Where there is something to see, and where the targets are at first.
FEATURES, START = (0, 2, 4), (1, 2, 3)
RNG = np.random.default_rng(3)
AWAY = np.abs(np.arange(PLACES)[:, None] - np.array(FEATURES))
#: Each target looks for any feature, and hardly two of them for the same one.
WEIGHTING = -2.0 * AWAY.min(axis=1) ** 2 + 0.3 * RNG.normal(size=(FRAMES, 3, PLACES))
A, B, C = AWAY.argmin(axis=1)[np.indices((PLACES,) * 3)]
JOINT = (
    WEIGHTING[:, 0, :, None, None]
    + WEIGHTING[:, 1, None, :, None]
    + WEIGHTING[:, 2, None, None, :]
    - 4.0 * (0.0 + (A == B) + (B == C) + (A == C))
)


@pytree_dataclass
class Steps(StepsInARow):
    """A step left, none, or right, the ends holding; expected where it is, or ``expected``."""

    expected: float | None = None

    def predict(self, partition, current, previous):
        return current if self.expected is None else jnp.full_like(current, self.expected)


@pytree_dataclass
class Tables(ReadFromTables):
    """Likelihoods read from tables; a frame is its weighting and joint ones."""

    def log_joint(self, observation, substates, log_probs):
        return observation[1][tuple(substates[:, 0].astype(int))]


def exact():
    """Evidence, and the posterior ``[5, 5, 5]`` in the last frame."""
    step = one_step()
    belief = np.zeros((PLACES,) * 3)
    belief[START] = 1
    for joint in JOINT:
        belief = np.einsum("abc,ad,be,cf->def", belief, step, step, step) * np.exp(joint)
    return belief.sum(), belief / belief.sum()


def tracker(chosen, **options):
    return jaxpf.Partitioned(
        dynamics=Steps(),
        likelihood=Tables(),
        ordering=chosen,
        initial=np.array(START, np.float32)[:, None],
        num_particles=N,
        resampling="multinomial",
        **options,
    )


def report(state, summary):
    return summary.log_evidence, summary.estimate[:, 0]


def runs_of(made, evidence):
    """Evidence over the exact one ``[R]``, and places ``[R, 3]`` in the last frame."""
    keys = jax.random.split(jax.random.key(7), RUNS)
    frames = jnp.asarray(WEIGHTING), jnp.asarray(JOINT)
    found = monte_carlo(made, keys, frames, record=report, batch_size=2000)
    log_evidence, places = (np.asarray(values, float) for values in found)
    return np.exp(log_evidence.sum(axis=1)) / evidence, places[:, -1]


def runs(chosen, **options):
    return runs_of(tracker(chosen, **options), exact()[0])


def true_places():
    posterior, grid = exact()[1], np.arange(PLACES)
    others = ((1, 2), (0, 2), (0, 1))
    return np.array([posterior.sum(axis=axes) @ grid for axes in others])


@pytree_dataclass
class Flipping(MovesLabels, Steps):
    """The same steps, and labels."""


@pytree_dataclass
class Labelled(Tables):
    """Joint by the label: targets that are independent, or one of which explains nothing."""

    def log_joint_labelled(self, observation, substates, log_probs, label):
        return jnp.where(label == 0, jnp.sum(log_probs), jnp.sum(log_probs[:2]) - 3.0)


def labelled(chosen):
    return dataclasses.replace(
        tracker(chosen, joint_weighting=True),
        dynamics=Flipping(),
        likelihood=Labelled(),
        initial_label=np.array([0.5, 0.5]),
    )


def test_a_label_that_moves_after_the_last_stage_counts():
    """Without resampling inside the frame, a weight is the joint likelihood by the new label."""
    made, frame = labelled(ordering.sir(3)), (jnp.asarray(WEIGHTING[0]), jnp.asarray(JOINT[0]))
    state, _ = jax.jit(lambda key: made.step(key, made.init(key), frame))(jax.random.key(0))
    assert np.ptp(state.label) == 1

    def log_joint(substates, label):
        log_probs = jax.vmap(made.likelihood.log_prob, (None, 0, 0))(
            frame, jnp.arange(3), substates
        )
        return made.likelihood.log_joint_labelled(frame, substates, log_probs, label)

    expected = jax.nn.log_softmax(jax.vmap(log_joint)(state.substates, state.label))
    np.testing.assert_allclose(state.log_weights, expected, rtol=1e-4)


@pytest.mark.statistical
@pytest.mark.slow
def test_a_joint_of_labels_is_given_the_likelihoods_of_single_targets():
    """By enumeration of all places and both labels; the stages weigh by something else."""
    step = one_step()
    flip = np.array([[0.7, 0.3], [0.3, 0.7]])
    belief = np.zeros((2, *(PLACES,) * 3))
    belief[(slice(None), *START)] = 0.5
    for w in WEIGHTING:
        two = w[0][:, None, None] + w[1][None, :, None] + 0 * w[2]
        joint = np.stack([two + w[2], two - 3.0])
        belief = np.einsum("labc,lm,ad,be,cf->mdef", belief, flip, step, step, step)
        belief *= np.exp(joint)
    ratio, places = runs_of(labelled(ordering.ps([0, 1, 2])), belief.sum())
    assert z_score(ratio, 1) < LIMIT
    others, grid = ((0, 2, 3), (0, 1, 3), (0, 1, 2)), np.arange(PLACES)
    true = np.array([belief.sum(axis=axes) @ grid for axes in others]) / belief.sum()
    assert (z_score(ratio[:, None] * places, true) < LIMIT).all()


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("name", ["ps", "dps"])
def test_evidence_and_places_are_unbiased_and_less_variable(name):
    chosen = {"ps": ordering.ps([0, 1, 2]), "dps": ordering.dps(3)}[name]
    joint, places = runs(chosen, joint_weighting=True)
    assert z_score(joint, 1) < LIMIT
    assert (z_score(joint[:, None] * places, true_places()) < LIMIT).all()
    plain, _ = runs(chosen)
    # A standard deviation from so many runs is known to about one per cent.
    assert np.log(joint).std() < 0.8 * np.log(plain).std()


@pytest.mark.statistical
@pytest.mark.slow
def test_it_stays_exact_with_adaptive_and_tempered_selection():
    joint, places = runs(
        ordering.ps([2, 0, 1]), joint_weighting=True, ess_threshold=0.6, tempering=0.7
    )
    assert z_score(joint, 1) < LIMIT
    assert (z_score(joint[:, None] * places, true_places()) < LIMIT).all()


@pytest.mark.statistical
@pytest.mark.slow
def test_kills_a_stage_that_does_not_divide_by_the_one_before(monkeypatch):
    monkeypatch.setattr(weighing, "_log_joint_before", lambda stage, carry: 0.0)
    jax.clear_caches()
    joint, _ = runs(ordering.ps([0, 1, 2]), joint_weighting=True)
    jax.clear_caches()
    assert z_score(joint, 1) > 20


@pytree_dataclass
class Pairs:
    """Two targets; place -1 is out of everybody's way."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        place = substate[0].astype(int)
        return jnp.where(place < 0, 0.0, observation[partition, jnp.maximum(place, 0)])

    def log_joint(self, observation, substates, log_probs):
        return jnp.sum(log_probs) - 4.0 * (substates[0, 0] == substates[1, 0])


@pytest.mark.slow
def test_of_two_partitions_only_what_is_expected_of_the_other_makes_a_difference():
    """P(A) and then P(A, B) / P(A) are the weights that the plain filter has at the end."""

    def run(**options):
        two = jaxpf.Partitioned(
            likelihood=Pairs(),
            ordering=ordering.ps([0, 1]),
            initial=np.array(START[:2], np.float32)[:, None],
            num_particles=50,
            **options,
        )
        _, summary = jax.jit(jaxpf.run)(two, jax.random.key(1), jnp.asarray(WEIGHTING[:, :2]))
        return summary

    plain = run(dynamics=Steps())
    out_of_the_way = run(dynamics=Steps(expected=-1.0), joint_weighting=True)
    for name in ("log_evidence", "estimate", "ess"):
        one, other = getattr(plain, name), getattr(out_of_the_way, name)
        np.testing.assert_allclose(one, other, rtol=2e-5, err_msg=name)
    joint = run(dynamics=Steps(), joint_weighting=True)
    assert not np.allclose(plain.log_evidence, joint.log_evidence, rtol=1e-3)


def test_dynamics_of_this_package_expect_what_they_do_without_noise():
    rng = np.random.default_rng(0)
    now, before = jnp.asarray(rng.normal(size=(2, 4, 5)), jnp.float32)
    partition = np.array([0, 1, 0, 1, 1])
    matrices = rng.normal(size=(2, 2, 4, 4)).astype(np.float32)
    dynamics = jaxpf.dynamics
    for one in (
        dynamics.RandomWalk(0.0),
        dynamics.AR2(0.0, 0.4),
        dynamics.FirstOrder(0.0),
        dynamics.LinearGaussian(
            matrices[0], np.zeros((2, 4, 4), np.float32), lag=matrices[1], offset=matrices[0, 0, :2]
        ),
    ):
        moved = one.propagate_all(jax.random.key(0), partition, now, before, np.zeros_like(now))
        np.testing.assert_allclose(
            one.predict_all(partition, now, before), moved, rtol=1e-4, atol=1e-5
        )
