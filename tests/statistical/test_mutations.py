"""Known faults, planted one at a time: each must throw the z-scores far out.

So the exactness tests are shown to see these faults.  A mutated kernel is traced through a new
function, because a compiled one would hide the mutation.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import (
    DEEP_TREE,
    FOREST,
    LIMIT,
    OBJECTS,
    TREE,
    WRONG,
    moments,
    objects,
    problem,
    scores,
    scores_of,
)
from proposed import Bad

from jaxpf import contract, ordering
from jaxpf.contract import calls
from jaxpf.filters.partitioned import ending, exchange, selection
from jaxpf.proposals import LocallyOptimal, Mixture
from jaxpf.resampling import weighted
from jaxpf.running import blocks

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

#: Enough to throw every fault out; the exactness tests have more.
RUNS, BATCH = 5_000, 1_000


def mutant_scores(exact, order, **settings):
    """``exact.scores`` through a kernel that is traced now."""

    def monte_carlo(tracker, keys, frames):
        states, groups = blocks.begin_batches(tracker, [keys]), blocks.in_groups(0, frames, ())
        return blocks.advance_batches(tracker, [keys], states, *groups, moments)[1][0]

    keys = jax.random.split(jax.random.key(1), RUNS).reshape(-1, BATCH)
    tracker = exact.tracker(order, **settings)
    recorded = jax.jit(monte_carlo)(tracker, keys, exact.frames)
    return scores_of(jax.tree.map(lambda x: x.reshape(RUNS, *x.shape[2:]), recorded), exact)


def mutate_weights(monkeypatch, weigh):
    """Replace the corrected weights of a resampling; the ancestors stay right."""
    original = weighted.weighted_resample

    def mutant(key, log_weights, log_selection, scheme, components, largest=None):
        chosen, right = original(key, log_weights, log_selection, scheme, components)
        return chosen, weigh(chosen, right, log_weights, components)

    monkeypatch.setattr(weighted, "weighted_resample", mutant)


def test_kills_the_inverse_of_rho_dropped(monkeypatch):
    def weigh(chosen, right, log_weights, components):
        return log_weights[chosen] - jnp.log(components.size[components.index])

    mutate_weights(monkeypatch, weigh)
    assert mutant_scores(problem(TREE), ordering.ps([0, 1, 2])).worst > WRONG


def test_kills_the_inverse_of_n_dropped(monkeypatch):
    def weigh(chosen, right, log_weights, components):
        return right + jnp.log(components.size[components.index])

    mutate_weights(monkeypatch, weigh)
    assert mutant_scores(problem(TREE), ordering.ps([0, 1, 2])).worst > WRONG


def test_kills_rho_normalised_across_components(monkeypatch):
    def weigh(chosen, right, log_weights, components):
        total = jax.nn.logsumexp(log_weights) - jnp.log(log_weights.shape[0])
        return jnp.full_like(right, total)

    mutate_weights(monkeypatch, weigh)
    assert mutant_scores(objects(), ordering.dps(4)).worst > WRONG


def test_kills_weights_kept_after_a_resampling(monkeypatch):
    original = selection.resample

    def mutant(tracker, key, log_weights, log_selection, components, largest=None):
        right = original(tracker, key, log_weights, log_selection, components)
        kept = log_weights[right.ancestors]
        return right._replace(log_weights=kept, equal=jnp.zeros((), bool))

    monkeypatch.setattr(selection, "resample", mutant)
    assert mutant_scores(problem(TREE), ordering.ps([0, 1, 2])).worst > WRONG


def _sharing(giver):
    """Slots of the same giver as groups, by sorting."""
    order = jnp.argsort(giver).astype(jnp.int32)
    ordered, slots = giver[order], jnp.arange(giver.shape[0], dtype=jnp.int32)
    first, behind = (jnp.searchsorted(ordered, ordered, side=side) for side in ("left", "right"))
    return exchange.Groups(
        order=order,
        position=jnp.argsort(order).astype(jnp.int32),
        rank=(slots - first).astype(jnp.int32),
        last=(behind - 1).astype(jnp.int32),
    )


def test_kills_a_redraw_from_the_resampled_set(monkeypatch):
    """Candidates must be the particles before the resampling, not their offspring."""

    def redraw(key, swap, offer, groups, slots, is_root):
        place, ancestors = groups.position, slots.ancestors
        before = jnp.where(groups.rank > 0, jnp.roll(offer.share, 1), 0.0)
        weight, start = (offer.share - before)[place], (place - groups.rank[place])[ancestors]
        likely = jnp.log(weight)[ancestors]
        logits = jnp.where(start[:, None] == start[None, :], likely[None, :], -jnp.inf)
        giver = ancestors[jax.random.categorical(key, logits, axis=1)].astype(jnp.int32)
        return giver, _sharing(giver)

    monkeypatch.setattr(exchange, "draw", redraw)
    found = mutant_scores(problem(DEEP_TREE), ordering.sps(DEEP_TREE), resampling="multinomial")
    assert found.worst > WRONG


def test_kills_a_swap_that_leaves_the_past_of_descendants_behind(monkeypatch):
    """On a single-root tree this fault is none: a group shares its past there."""

    original = ordering.carriers

    def only_itself(order, level, tree):
        carrier = original(order, level, tree)
        return np.where(carrier == np.arange(len(order)), carrier, -1).astype(np.int32)

    monkeypatch.setattr(ordering, "carriers", only_itself)
    exact = problem(FOREST, transition=0.7, lag=0.3, coupling=1.2, initial_scale=1.0)
    assert scores(exact, ordering.sps(FOREST)).worst > WRONG


def test_kills_a_swap_that_leaves_the_lags_of_the_part_behind(monkeypatch):
    original = ending.finish

    def mutant(tracker, label_key, observation, components, carry):
        state, summary = original(tracker, label_key, observation, components, carry)
        # Nobody is resampled after the only level: slot i's own past is what slot i drew from.
        own = carry.stages[1][:, tracker.ordering.rank[0]]
        return dataclasses.replace(state, lagged=state.lagged.at[1].set(own)), summary

    monkeypatch.setattr(ending, "finish", mutant)
    assert mutant_scores(objects(), ordering.sps(OBJECTS)).worst > WRONG


@pytest.mark.parametrize("fault", ["transition", "partition", "mixture", "none"])
def test_kills_faults_in_the_weights_of_a_proposal(fault, monkeypatch):
    """The transition left out; a density of the wrong partition; one of one component alone."""
    density, of_transition = calls.proposal_log_density_all, contract.log_density_all
    proposal = {"partition": LocallyOptimal(), "mixture": Mixture(Bad(), 0.5)}.get(fault, Bad())

    def of_next(proposal, observation, partition, *move):
        return density(proposal, observation, (partition + 1) % 3, *move)

    def of_one(proposal, *move):
        if not isinstance(proposal, Mixture):
            return density(proposal, *move)
        return jnp.log(proposal.share) + density(proposal.proposal, *move)

    if fault == "transition":
        monkeypatch.setattr(
            contract, "log_density_all", lambda *move: jnp.zeros_like(of_transition(*move))
        )
    if fault in ("partition", "mixture"):
        mutant = of_next if fault == "partition" else of_one
        monkeypatch.setattr(calls, "proposal_log_density_all", mutant)
    worst = mutant_scores(problem(TREE), ordering.ps([0, 1, 2]), proposal=proposal).worst
    assert worst < LIMIT if fault == "none" else worst > WRONG


def test_the_kernel_without_a_mutation_passes_the_same_way(monkeypatch):
    mutate_weights(monkeypatch, lambda chosen, right, log_weights, components: right)
    assert mutant_scores(problem(TREE), ordering.ps([0, 1, 2])).worst < LIMIT
