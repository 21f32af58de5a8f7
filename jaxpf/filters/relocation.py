"""Relocation: search the whole frame for objects that are lost.

A partition with low confidence moves by a mixture.  With probability 1 - epsilon it moves by its
dynamics.  With probability epsilon its centre, the substate's first two coordinates, is uniform
over the frame and at rest, while the other coordinates move by the dynamics.  Epsilon depends only
on the confidence before the frame.

Uniform draws would almost never hit the object.  Jumps are therefore drawn from a density that is
constant in each cell of a coarse grid, proportional to the tempered likelihood at the cell's
centre, and mixed with the uniform density.  Each jump has the weight uniform density over drawn
density.  Given its epsilons, every weight of the mixture is proper and the evidence unbiased.  It
is the evidence of a fixed model if the log odds depend only on the frames, not on the filter's
estimates.

Relocation is not a ``jaxpf.contract.Proposal``: it changes the model, needs no density of the
dynamics, and also sets the substate before the jump.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract.errors import check_has, check_separate
from jaxpf.contract.lost import LOST_BELOW
from jaxpf.contract.numbers import check_array
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.lowering.prefix import running_sum

if TYPE_CHECKING:
    from jaxpf.filters.labelled.tracker import Labelled
    from jaxpf.filters.partitioned.tracker import Partitioned

#: Approximate number of cells of the grid.
_CELLS = 800
#: Exponent of the likelihood in the cells' probabilities, since cell centres miss its peaks.
_TEMPER = 0.5
#: Share of the uniform density in the jumps' density, which bounds the weights.
_UNIFORM = 0.1


@pytree_dataclass
class Relocation:
    """Settings of the search for lost objects.

    Attributes:
        epsilon: probability per frame that a particle of a lost object jumps at confidence 0,
            ``[]`` or ``[P]``; falls to 0 as the confidence rises to one half.
        extent: width and height of the frame, ``[2]``, pixels.
        grid: static, numbers of rows and columns of cells.
    """

    epsilon: ArrayLike
    extent: ArrayLike
    grid: tuple[int, int] = static_field(default=(24, 32))

    def epsilon_at(self, confidence: jax.Array) -> jax.Array:
        """Epsilon per partition, ``[P]``, given the confidence before the frame."""
        doubt = jnp.clip(1 - confidence / LOST_BELOW, 0, 1)
        return jnp.asarray(self.epsilon, confidence.dtype) * doubt


def relocation_in(frame_shape: tuple[int, int], epsilon: ArrayLike) -> Relocation:
    """Relocation in a frame ``(height, width)``, on about 800 roughly square cells."""
    check_array("frame_shape", frame_shape, "height and width of a frame, [2]", least=1)
    height, width = frame_shape
    rows = max(round(np.sqrt(_CELLS * height / width)), 1)
    extent = np.array([width, height], np.float32)
    return Relocation(epsilon, extent, (rows, max(round(_CELLS / rows), 1)))


def check_relocation(tracker: "Partitioned | Labelled") -> None:
    """Refuse relocation if no confidence is reported, or if it would be wrong."""
    relocation, likelihood = tracker.relocation, tracker.likelihood
    if relocation is None:
        return
    has_odds = contract.has_log_odds(likelihood)
    check_has("relocation", likelihood, "log_odds of the likelihood", has_odds)
    contract.check_uncoupled(tracker.dynamics, "relocation")
    check_separate(
        "relocation",
        (any(parent >= 0 for parent in getattr(tracker, "parents", ())), "a part tree"),
        (getattr(tracker, "population", "fixed") == "open", "an open population"),
        (contract.looks_near(likelihood), f"{type(likelihood).__name__}, which looks nearby only"),
        (contract.has_log_joint(likelihood), "a likelihood that has log_joint"),
        (tracker.motion_gradient != "pathwise", f"motion_gradient={tracker.motion_gradient!r}"),
    )
    for name, wanted, least, most in (
        ("epsilon", "from 0 to 1", 0, 1),
        ("extent", "width and height in pixels, [2]", 1, np.inf),
        ("grid", "rows and columns of cells, from 1 to 1000, [2]", 1, 1000),
    ):
        check_array(f"relocation's {name}", getattr(relocation, name), wanted, least, most)


class Jumps(NamedTuple):
    """Candidate jumps of all partitions and particles in a frame.

    Attributes:
        happens: bool ``[P, N]``, whether the particle jumps.
        position: ``[2, P, N]``, the new centre.
        log_weight: ``[P, N]``, log of uniform density over drawn density.
    """

    happens: jax.Array
    position: jax.Array
    log_weight: jax.Array


def draw_jumps(
    tracker: Any, uniform: jax.Array, log_odds: jax.Array, estimate: jax.Array, observation: Any
) -> Jumps:
    """Draw a frame's jumps; partitions that do not jump cost nothing.

    Args:
        tracker: has ``relocation``.
        uniform: random numbers in [0, 1), ``[P, 4, N]``.
        log_odds: ``[P]``, log odds that objects were at their estimates in the previous frame.
        estimate: ``[D, P]`` of the previous frame; supplies the other coordinates, such as size.
        observation: this frame's observation.
    """
    dtype = estimate.dtype
    epsilon = tracker.relocation.epsilon_at(jax.nn.sigmoid(log_odds)).astype(dtype)

    def of_partition(item):
        partition, epsilon, estimate, uniform = item

        def draw():
            return _draw_for_one(tracker, partition, epsilon, estimate, uniform, observation)

        def stay():
            zeros = jnp.zeros(tracker.num_particles, dtype)
            return Jumps(zeros > 0, jnp.stack([zeros, zeros]), zeros)

        return lax.cond(epsilon > 0, draw, stay)

    partitions = jnp.arange(tracker.num_partitions)
    jumps = lax.map(of_partition, (partitions, epsilon, estimate.T, uniform))
    return jumps._replace(position=jnp.swapaxes(jumps.position, 0, 1))


def apply_jumps(
    jumps: Jumps, partition: jax.Array, substates: jax.Array, left: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Apply jumps: new substates and previous substates ``[D, N]``, and log-weights.

    Args:
        jumps: the frame's jumps.
        partition: int ``[N]``, the partition that each particle processes.
        substates: ``[D, N]``, moved substates.
        left: ``[D, N]``, previous substates.  A jump overwrites these too, so that it is at rest.
    """
    slot = jnp.arange(partition.shape[0])
    happens, position = jumps.happens[partition, slot], jumps.position[:, partition, slot]

    def put(substates):
        return jnp.concatenate([jnp.where(happens, position, substates[:2]), substates[2:]])

    log_weight = jnp.where(happens, jumps.log_weight[partition, slot], 0.0)
    return put(substates), put(left), log_weight


def _draw_for_one(tracker, partition, epsilon, estimate, uniform, observation) -> Jumps:
    """Jumps of one partition: entries ``[N]``, positions ``[2, N]``, from ``uniform [4, N]``."""
    relocation, dtype = tracker.relocation, estimate.dtype
    rows, columns = relocation.grid
    extent = jnp.asarray(relocation.extent, dtype)
    size = extent / jnp.array([columns, rows], dtype)
    centres = (jnp.stack(jnp.divmod(jnp.arange(rows * columns), columns)[::-1]) + 0.5) * size[
        :, None
    ]
    places = jnp.broadcast_to(estimate[:, None], (len(estimate), rows * columns))
    log_prob = contract.log_prob_all(
        tracker.likelihood,
        observation,
        jnp.full(rows * columns, partition),
        jnp.concatenate([centres.astype(dtype), places[2:]]),
    )
    share = _shares(log_prob.astype(dtype))
    below = running_sum(share)
    cell = jnp.searchsorted(below, uniform[1] * below[-1], side="right")
    cell = jnp.minimum(cell, rows * columns - 1)
    corner = jnp.stack(jnp.divmod(cell, columns)[::-1]).astype(dtype)
    return Jumps(
        happens=uniform[0] < epsilon,
        position=(corner + uniform[2:]) * size[:, None],
        log_weight=-jnp.log(share[cell]) - math.log(rows * columns),
    )


def _shares(log_prob: jax.Array) -> jax.Array:
    """Probability of drawing each cell, given log-likelihoods at their centres."""
    finite = jnp.isfinite(log_prob)
    tempered = jnp.where(finite, _TEMPER * jnp.where(finite, log_prob, 0.0), -jnp.inf)
    largest = jnp.where(jnp.any(finite), jnp.max(tempered), 0.0)
    raw = jnp.exp(tempered - largest)
    total = jnp.sum(raw)
    uniform = 1.0 / log_prob.shape[0]
    by_likelihood = jnp.where(total > 0, raw / jnp.where(total > 0, total, 1.0), uniform)
    return (1 - _UNIFORM) * by_likelihood + _UNIFORM * uniform
