"""Relocation of objects that are probably lost: exact on a small grid.

Two objects step along the rows of a frame of 4 x 3 pixels.  The exact answer is a forward recursion
over where an object is and where it was.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import monte_carlo
from records import z_score

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass
from jaxpf.contract import static_field
from jaxpf.filters import Relocation, relocation

COLUMNS, ROWS, FRAMES, N, RUNS, LIMIT = 4, 3, 4, 12, 20_000, 4.5
START = ((0, 1), (3, 2))
RNG = np.random.default_rng(5)
#: Log-likelihoods of both objects at every pixel, and log odds that each is still there.
TABLES = 1.5 * RNG.normal(size=(FRAMES, 2, ROWS, COLUMNS))
ODDS = np.array([[-6.0, 5.0], [-5.0, -6.0], [6.0, -6.0], [0.0, 0.0]])
EPSILON = 0.6
ORDERINGS = {
    "sir": ordering.sir(2),
    "ps": ordering.ps([1, 0]),
    "dps": ordering.dps(2),
    "sps": ordering.sps((-1, -1)),
}


@pytree_dataclass
class Steps:
    """Every other step repeats the last one; the rest go left, right or nowhere."""

    def propagate(self, key, partition, current, previous, parent):
        which, where = jax.random.split(key)
        again = jnp.clip(jnp.floor(current[0]) - jnp.floor(previous[0]), -1, 1)
        step = jnp.where(jax.random.bernoulli(which), again, jax.random.randint(where, (), -1, 2))
        u = jnp.clip(jnp.floor(current[0]) + step, 0, COLUMNS - 1)
        return jnp.stack([u + 0.5, current[1], 2 * current[2]])


@pytree_dataclass
class Tables:
    """A frame is log-likelihoods and log odds, whatever a filter believes."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        column, row = jnp.floor(substate[:2]).astype(int)
        return observation[0][partition, row, column]

    def log_odds(self, observation, partition, substate):
        return observation[1][partition]


def exact(confidence):
    """Evidence of both objects ``[2]``, and where they are in the end ``[2, 2]``."""
    evidence, places = [], []
    for number, (u, v) in enumerate(START):
        belief = np.zeros((COLUMNS, COLUMNS, ROWS))  # column, column before, row
        belief[u, u, v] = 1
        for time in range(FRAMES):
            doubt = 1 - 2 * confidence[time - 1, number] if time else 0
            epsilon = EPSILON * np.clip(doubt, 0, 1)
            moved = np.zeros_like(belief)
            for now, before in np.ndindex(COLUMNS, COLUMNS):
                again = np.clip(now - before, -1, 1)
                for step in (-1, 0, 1):
                    chance = 1 / 6 + (step == again) / 2
                    there = np.clip(now + step, 0, COLUMNS - 1)
                    moved[there, now] += (1 - epsilon) * chance * belief[now, before]
            rest = np.arange(COLUMNS)
            moved[rest, rest] += epsilon * belief.sum() / (COLUMNS * ROWS)
            belief = moved * np.exp(TABLES[time, number].T)[:, None]
        total = belief.sum()
        evidence.append(total)
        columns, rows = belief.sum(axis=(1, 2)), belief.sum(axis=(0, 1))
        places.append([columns @ np.arange(COLUMNS) / total, rows @ np.arange(ROWS) / total])
    return np.array(evidence), np.array(places)


def tracker(method, **settings):
    centres = [[u + 0.5, v + 0.5, 1.0] for u, v in START]
    lost = Relocation(EPSILON, np.array([4.0, 3.0]), (2, 2))
    defaults = {"relocation": lost, "num_particles": N}
    return jaxpf.Partitioned(
        dynamics=Steps(),
        likelihood=Tables(),
        ordering=ORDERINGS[method],
        initial=np.array(centres, np.float32),
        **(defaults | settings),
    )


def report(state, summary):
    places = jnp.floor(state.lagged[0, :2]) @ jnp.exp(state.log_weights)
    return summary.log_evidence, places.T, summary.confidence, state.lagged[0, 2]


def runs(method, **settings):
    """Evidence over the exact one ``[R]``, places ``[R, 2, 2]`` in the end, and exact ones."""
    keys = jax.random.split(jax.random.key(7), RUNS)
    frames = jnp.asarray(TABLES, jnp.float32), jnp.asarray(ODDS, jnp.float32)
    made = tracker(method, **settings)
    found = monte_carlo(made, keys, frames, record=report, batch_size=2000)
    log_evidence, places, confidence, sizes = (np.asarray(values, float) for values in found)
    assert (sizes[:, -1] == 2**FRAMES).all()  # which moves as ever
    assert (confidence == confidence[0]).all()  # of the frames alone, here
    assert (confidence[0, :3] < 0.3).any(axis=0).all()
    evidence, expected = exact(confidence[0])
    return np.exp(log_evidence.sum(axis=1)) / evidence.prod(), places[:, -1], expected


@pytest.mark.statistical
def test_draws_weigh_as_much_as_the_uniform_density():
    made = tracker("ps", num_particles=4000)
    state = made.init(jax.random.key(0))
    # The first object is lost, the second is not.
    state = dataclasses.replace(state, log_odds=jnp.array([-20.0, 3.0]))
    frame = jnp.asarray(TABLES[0], jnp.float32), jnp.asarray(ODDS[0], jnp.float32)
    uniform = jax.random.uniform(jax.random.key(1), (2, 4, made.num_particles), np.float32)
    jumps = relocation.draw_jumps(made, uniform, state.log_odds, state.lagged[0, ..., 0], frame)
    weight = np.exp(np.asarray(jumps.log_weight[0], float))
    assert weight.std() > 0.5
    assert z_score(weight, 1) < LIMIT
    for power in (1, 2):
        moments = np.array([[COLUMNS], [ROWS]]) ** power / (power + 1)
        found = weight * np.asarray(jumps.position[:, 0]) ** power
        assert (z_score(found.T, moments.T) < LIMIT).all()
    assert z_score(np.asarray(jumps.happens[0], float), EPSILON) < LIMIT
    assert not jumps.happens[1].any()


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [pytest.param("ps", marks=pytest.mark.always), "sir", "dps", "sps"]
)
def test_evidence_and_places_of_the_mixture_are_unbiased(method):
    evidence, places, expected = runs(method)
    assert z_score(evidence, 1) < LIMIT
    assert (z_score(evidence[:, None, None] * places, expected) < LIMIT).all()


@pytest.mark.statistical
@pytest.mark.slow
def test_each_label_has_the_evidence_of_its_own_mixture():
    labelled = jaxpf.Labelled(
        dynamics=Steps(),
        likelihood=Tables(),
        initial=np.array([[u + 0.5, v + 0.5, 1.0] for u, v in START], np.float32),
        relocation=Relocation(EPSILON, np.array([4.0, 3.0]), (2, 2)),
        num_particles=2 * N,
    )
    keys = jax.random.split(jax.random.key(8), RUNS)
    frames = jnp.asarray(TABLES, jnp.float32), jnp.asarray(ODDS, jnp.float32)

    def report(state, summary):
        return summary.label_log_evidence, summary.confidence

    found = monte_carlo(labelled, keys, frames, record=report, batch_size=2000)
    log_evidence, confidence = (np.asarray(values, float) for values in found)
    evidence, _ = exact(confidence[0])
    assert (z_score(np.exp(log_evidence.sum(axis=1)) / evidence, 1) < LIMIT).all()


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("fault", ["weight forgotten", "not at rest"])
def test_kills(fault, monkeypatch):
    original = relocation.apply_jumps

    def mutant(jumps, partition, substates, left):
        moved, rest, log_weight = original(jumps, partition, substates, left)
        if fault == "not at rest":
            return moved, left, log_weight
        return moved, rest, jnp.zeros_like(log_weight)

    monkeypatch.setattr(relocation, "apply_jumps", mutant)
    jax.clear_caches()
    evidence, places, expected = runs("dps")
    jax.clear_caches()
    worst = max(z_score(evidence, 1), z_score(evidence[:, None, None] * places, expected).max())
    assert worst > 10


def whole(state, summary):
    return state, summary


@pytest.mark.slow
def test_nothing_changes_while_nobody_is_lost():
    frames = jnp.asarray(TABLES, jnp.float32), jnp.full(ODDS.shape, 4.0)
    once = jax.jit(jaxpf.run, static_argnames="record")
    with_it, without = (
        once(tracker("dps", **settings), jax.random.key(3), frames, record=whole)[1]
        for settings in ({}, {"relocation": None})
    )
    assert (with_it[1].confidence > 0.5).all()
    jax.tree.map(np.testing.assert_array_equal, with_it, without)


@pytree_dataclass
class Coupled(Steps):
    """Steps that ask for the others, too."""

    coupled: bool = static_field(default=True)


@pytree_dataclass
class Sure:
    """A likelihood that cannot tell who is lost."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return 0.0 * substate[0]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"likelihood": Sure()}, "log_odds"),
        ({"dynamics": Coupled()}, "Coupled"),
        ({"parents": (-1, 0)}, "part tree"),
        ({"gradient": jaxpf.gradients.Soft()}, "gradient"),
        ({"relocation": Relocation(1.5, np.ones(2))}, "epsilon"),
    ],
)
def test_where_it_cannot_work_it_is_refused(settings, message):
    lost = Relocation(0.1, np.ones(2))
    options = {"dynamics": Steps(), "likelihood": Tables(), "relocation": lost}
    with pytest.raises(InputError, match=message):
        jaxpf.Partitioned(
            ordering=ordering.ps([0, 1]),
            initial=np.zeros((2, 3)),
            **(options | settings),
        )
