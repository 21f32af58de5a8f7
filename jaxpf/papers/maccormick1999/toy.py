"""Figures 3, 9 and 10: two targets on a line, and sampled jointly or one after the other.

The steps shown are the filter's own: ``jaxpf.filters.partitioned.kernel``, stage by stage.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf import ordering as orderings
from jaxpf.dynamics.gaussian import RandomWalk
from jaxpf.filters.partitioned import ending, kernel
from jaxpf.filters.partitioned.carry import Shared
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.likelihoods import Gaussian
from jaxpf.likelihoods.contours import (
    Features,
    detection_probabilities,
    line_weights,
    log_ratio,
    poisson_clutter,
)
from jaxpf.lowering.programs import compiled

#: Positions of four features in figure 3, read off approximately, pixels from the line's middle.
FEATURES = (-50.0, -15.0, 20.0, 55.0)
_LENGTH, _SIGMA, _CLUTTER = 161, 7.0, 2.0


def likelihood(boundaries: ArrayLike) -> np.ndarray:
    """``p~_c / p_0`` ``[...]`` of the line for boundaries ``[c, ...]``, pixels from its middle."""
    return np.asarray(_likelihood(jnp.asarray(boundaries, jnp.float32)))


def peaks() -> tuple[np.ndarray, np.ndarray]:
    """Two-target likelihood with both at one feature, ``[4]``, and at pairs of them, ``[6]``."""
    first, second = np.triu_indices(len(FEATURES), 1)
    places = np.array(FEATURES)
    together = likelihood(np.stack([places, places]))
    return together, likelihood(np.stack([places[first], places[second]]))


def ratio_of_peaks() -> float:
    """The highest peak on the diagonal over the lowest beside it."""
    together, apart = peaks()
    return float(together.max() / apart.min())


@compiled
def _likelihood(boundaries: jax.Array) -> jax.Array:
    count, shape = len(FEATURES), boundaries.shape[1:]
    places = jnp.broadcast_to(jnp.array(FEATURES).reshape(-1, *[1] * len(shape)), (count, *shape))
    features = Features(places, jnp.ones(places.shape, bool))
    weights = line_weights(
        # The distribution extends past the number of features, because a full line may have had
        # more.
        poisson_clutter(_CLUTTER, 3 * count),
        detection_probabilities(len(boundaries)),
        _LENGTH,
    )
    there = jnp.ones(boundaries.shape, bool)
    return jnp.exp(log_ratio(weights, features, boundaries, there, _SIGMA, _LENGTH / 2))


#: Ratio of the spread of the dynamics to the width of the posterior.
_NARROWER = 8.0
PARTICLES, _RUNS = 150, 40
TARGET = (1.2, -0.8)
#: Standard deviation of the prior.
_PRIOR = 0.5
#: The paper's filters: conventional, and with an order for each value of y (figure 8).
CONVENTIONAL, BRANCHED = "SIR", "branched PS"
#: Operations that lead to the steps shown.
STEPS = {
    CONVENTIONAL: ("the prior", "A moved", "A weighed", "B moved, both weighed"),
    BRANCHED: ("the prior", "first moved", "weighted resampling", "both moved and weighed"),
}


class Step(NamedTuple):
    """The particles at one step of a frame, in R runs.

    Attributes:
        substates: ``[R, N, 2]``.
        weights: ``[R, N]``, sum 1.
        labels: ``[R, N]``, y, the target that is searched first; 0 throughout for ``CONVENTIONAL``.
    """

    substates: np.ndarray
    weights: np.ndarray
    labels: np.ndarray

    @property
    def ess(self) -> np.ndarray:
        """``[R]``, eq. 6."""
        return 1 / (self.weights**2).sum(axis=1)


def tracker_of(method: str) -> Partitioned:
    """Build a filter by name."""
    is_branched = method == BRANCHED
    return Partitioned(
        dynamics=RandomWalk(scale=1.0),
        likelihood=Gaussian(jnp.full((2, 1, 1), 1 / _NARROWER)),
        ordering=orderings.branched([[0, 1], [1, 0]]) if is_branched else orderings.sir(2),
        initial=jax.tree_util.Partial(_prior),
        initial_label=np.full(2, 0.5, np.float32) if is_branched else None,
        num_particles=PARTICLES,
    )


def steps(seed: int) -> dict[str, list[Step]]:
    """Method -> the ``STEPS`` of one frame."""
    keys = jax.random.split(jax.random.key(seed), _RUNS)
    recorded = {name: compiled(jax.vmap(partial(frame, tracker_of(name))))(keys) for name in STEPS}
    return {name: [_step(*each) for each in stages] for name, stages in recorded.items()}


def frame(tracker: Partitioned, key: jax.Array) -> list[tuple[jax.Array, ...]]:
    """Substates ``[2, N]``, log-weights and labels ``[N]`` at each of ``STEPS``.

    Does what ``tracker.step`` does, and records the intermediate particles.
    """
    init_key, step_key = jax.random.split(key)
    prior = tracker.init(init_key)
    observation = tracker.observe(jnp.asarray(TARGET).reshape(2, 1))
    begin_key, stages_key = jax.random.split(step_key)
    state, components, carry = kernel.begin(tracker, begin_key, prior)
    shared = Shared(tracker, state, observation, components)

    def shown(state) -> tuple[jax.Array, ...]:
        labels = jnp.zeros(PARTICLES, jnp.int32) if state.label is None else state.label
        return state.lagged[0, 0], state.log_weights, labels

    recorded = [shown(prior)]
    for stage in map(jnp.asarray, range(2)):
        is_first, at_stage = len(recorded) == 1, jax.random.fold_in(stages_key, stage)
        move, select, exchange, weigh = jax.random.split(at_stage, 4)
        before, drawn = carry, kernel.move(shared, move, stage, carry)
        carry = kernel.weigh(shared, weigh, stage, carry, drawn)
        if is_first:
            # The moved particles with the weights from before the move.
            moved = carry._replace(log_weights=before.log_weights)
            recorded.append(_whole(shared, stage, moved))
        chosen = partial(kernel.select, shared, select, stage, before.log_weights)
        carry = kernel.exchange(shared, exchange, stage, carry, chosen)
        if is_first:
            recorded.append(_whole(shared, stage, carry))
    label_key = jax.random.fold_in(stages_key, 2)
    recorded.append(shown(ending.finish(tracker, label_key, observation, components, carry)[0]))
    return recorded


def _whole(shared: Shared, stage: jax.Array, carry: Any) -> tuple[jax.Array, ...]:
    """All targets after a stage; targets that have not moved yet keep their last position."""
    ordering, last = shared.tracker.ordering, shared.state.lagged[0, 0]  # [P, N]
    partition = ordering.order[shared.components.index].T  # [P, N], of every row
    rows = jnp.where(
        jnp.arange(2)[:, None] <= stage,
        jnp.take_along_axis(carry.stages[0, 0], carry.lineage, axis=1),
        last[partition, carry.lineage],
    )
    rank = ordering.rank[shared.components.index].T
    log_weights = jax.nn.log_softmax(carry.log_weights)
    return jnp.take_along_axis(rows, rank, axis=0), log_weights, carry.label


def _prior(key: jax.Array) -> jax.Array:
    return _PRIOR * jax.random.normal(key, (2, 1))


def _step(substates: jax.Array, log_weights: jax.Array, labels: jax.Array) -> Step:
    weights = np.exp(np.asarray(log_weights, float))
    weights /= weights.sum(axis=1, keepdims=True)
    return Step(np.moveaxis(np.asarray(substates), 1, 2), weights, np.asarray(labels))
