"""Posterior of a model's parameters by particle marginal Metropolis-Hastings.

The likelihood is a particle filter's unbiased estimate of the evidence.  The chain then targets the
exact posterior for any number of particles (Andrieu, Doucet & Holenstein 2010).  The number of
particles only affects mixing, which is best where the log evidence has a variance of about 1
(Doucet, Pitt, Deligiannidis & Kohn 2015).
"""

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from jaxpf import running
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete, pytree_dataclass, static_field
from jaxpf.filters.initial import check_count
from jaxpf.running import missing_frames
from jaxpf.running.checks import check_run
from jaxpf.tuning.objectives import keep_log_evidence

#: Acceptance rate that warm-up targets; noise in the evidence alone rejects half of the moves.
_ACCEPTANCE = 0.2
#: Initial step of the random walk, relative to the parameters.
_FIRST_STEP = 0.1
#: Number of pilot runs that estimate the variance of the log evidence.
_PILOT_RUNS = 64


@pytree_dataclass
class Posterior:
    """Draws of parameters from C chains, S draws each, after warm-up.

    Attributes:
        parameters: pytree of the parameters; leaves ``[C, S, ...]``.
        log_evidence: ``[C, S]``, the estimate with which each draw was accepted.
        log_prior: ``[C, S]``.
        accepted: ``[C, S]`` bool, whether the move was accepted.
        num_particles: number of particles of the filters.
    """

    parameters: Any
    log_evidence: jax.Array
    log_prior: jax.Array
    accepted: jax.Array
    num_particles: int = static_field()

    def datatree(self) -> Any:
        """An ``xarray.DataTree`` in ArviZ's layout, for ``arviz_stats.summary`` and plots."""
        try:
            import arviz_base
        except ModuleNotFoundError:
            raise InputError(
                "ArviZ's trees need arviz-base, which is missing; pip install 'jaxpf[formats]'."
            ) from None
        leaves = jax.tree_util.tree_leaves_with_path(self.parameters)
        groups = {
            "posterior": {
                jax.tree_util.keystr(path, simple=True, separator=".") or "parameter": leaf
                for path, leaf in leaves
            },
            "sample_stats": {
                "lp": self.log_evidence + self.log_prior,
                "log_evidence": self.log_evidence,
                "accepted": self.accepted,
            },
        }
        attributes = {"inference_library": "jaxpf", "num_particles": self.num_particles}
        return arviz_base.from_dict(jax.tree.map(np.asarray, groups), attrs={"/": attributes})


def pmmh(
    build: Callable[[Any], Any],
    log_prior: Callable[[Any], jax.Array],
    key: jax.Array,
    frames: Any,
    initial: Any,
    *,
    num_draws: int = 1000,
    num_warmup: int = 500,
    num_chains: int = 4,
    num_particles: int | None = None,
    observed: Any = None,
) -> Posterior:
    """Draw parameters from their posterior given frames.

    All chains advance together.  They share a Gaussian random walk whose covariance and scale are
    adapted during warm-up and fixed afterwards.  Pass named functions: each new function
    recompiles.

    Args:
        build: parameters -> tracker with an unbiased ``log_evidence``, such as
            ``jaxpf.state_space(..., parameters=p)``.
        log_prior: parameters -> log prior density ``[]``, up to a constant; -inf outside its
            support, where no tracker is run.
        key: random key.
        frames: as for ``jaxpf.run``.
        initial: starting values, any pytree of floats; chains start near them.
        num_draws: S, draws kept per chain.
        num_warmup: warm-up draws per chain, which are discarded.
        num_chains: C.
        num_particles: number of particles of the trackers.  By default it is chosen at the start
            and half-way through warm-up, for a log evidence with a variance of about 1.  Inside a
            user's ``jit`` the default is the trackers' own number.
        observed: as for ``jaxpf.run``.

    Raises:
        InputError: a number is below 1, parameters are not floats, or the start is excluded by the
            prior or cannot explain the frames.
    """
    counts = {"num_draws": num_draws, "num_warmup": num_warmup, "num_chains": num_chains}
    if num_particles is not None:
        counts["num_particles"] = num_particles
    for name, value in counts.items():
        check_count(name, value)
    if not all(jnp.issubdtype(jnp.result_type(x), jnp.floating) for x in jax.tree.leaves(initial)):
        raise InputError(f"initial={initial!r} must hold floats alone; write 1.0 for 1.")
    initial = jax.tree.map(lambda x: jnp.asarray(x, float), initial)
    tracker = build(initial)
    if "num_particles" not in getattr(tracker, "__dataclass_fields__", ()):
        raise InputError(
            f"build returns a {type(tracker).__name__}, whose num_particles cannot be set; return "
            "a tracker such as jaxpf.state_space(..., parameters=p)."
        )
    prior = log_prior(initial)
    if prior is None or jnp.shape(prior) != ():
        what = "nothing" if prior is None else f"shape {list(jnp.shape(prior))}"
        raise InputError(f"log_prior returns {what}; return one number, a sum over parameters.")
    check_run(tracker, frames)
    marked, frames = missing_frames.marked(tracker, frames, observed)
    is_known = is_concrete(key, frames, initial, tracker)
    if is_known and not np.isfinite(prior):
        raise InputError(f"the prior excludes the start {initial!r:.200}; start inside of it.")
    number = num_particles or tracker.num_particles
    model = _Model(build, log_prior, isinstance(marked, missing_frames.WithGaps), number)
    pilot_key, start_key, *keys = jax.random.split(running.as_key(key), 5)
    start, unravel = ravel_pytree(initial)
    spread = _FIRST_STEP * jnp.maximum(jnp.abs(start), _FIRST_STEP)
    place = start + spread * jax.random.normal(start_key, (num_chains, start.size))
    possible = ~jnp.isneginf(jax.vmap(lambda z: log_prior(unravel(z)))(place))
    unknown = jnp.full(num_chains, -jnp.inf)  # accepts the first move
    chains = _Chains(jnp.where(possible[:, None], place, start), unknown, unknown)
    walk = _Walk(start, jnp.diag(spread**2), jnp.log(2.38 / math.sqrt(start.size)))
    steps = np.arange(num_warmup + num_draws)
    rates = np.where(steps < num_warmup, (steps + 2.0) ** -0.6, 0.0)
    if is_known and num_particles is None:
        model = _with_chosen_number(model, pilot_key, frames, initial)
        half = -(-num_warmup // 2)
        chains, walk, _ = _advance(model, keys[0], frames, initial, chains, walk, rates[:half])
        rates, middle = rates[half:], unravel(walk.mean)
        if np.isfinite(log_prior(middle)):
            model = _with_chosen_number(model, keys[1], frames, middle)
    kept = _advance(model, keys[2], frames, initial, chains, walk, rates)[2]
    drawn, accepted = jax.tree.map(lambda x: jnp.swapaxes(x[-num_draws:], 0, 1), kept)
    if is_known and np.isneginf(drawn.log_evidence[:, -1]).any():  # a chain accepted no move
        raise InputError(
            f"the parameters {initial!r:.200} cannot explain the frames with "
            f"{model.num_particles} particles; start elsewhere, or give more particles."
        )
    return Posterior(
        parameters=jax.vmap(jax.vmap(unravel))(drawn.place),
        log_evidence=drawn.log_evidence,
        log_prior=drawn.log_prior,
        accepted=accepted,
        num_particles=model.num_particles,
    )


class _Model(NamedTuple):
    """Static definition of the chains' target distribution."""

    build: Callable
    log_prior: Callable
    has_gaps: bool
    num_particles: int

    def log_evidence(self, parameters: Any, key: jax.Array, frames: Any) -> jax.Array:
        """Estimate the log evidence ``[]``; -inf instead of NaN."""
        tracker = dataclasses.replace(self.build(parameters), num_particles=self.num_particles)
        if self.has_gaps:
            tracker = missing_frames.WithGaps(tracker)
        total = jnp.sum(running.run_compiled(tracker, key, frames, keep_log_evidence)[1])
        return jnp.where(jnp.isnan(total), -jnp.inf, total)

    def target(self, parameters: Any, key: jax.Array, frames: Any, fallback: Any) -> Any:
        """Log prior and log evidence; where the prior is 0, the tracker runs at ``fallback``."""
        log_prior = self.log_prior(parameters)
        possible = log_prior > -jnp.inf
        used = jax.tree.map(lambda x, y: jnp.where(possible, x, y), parameters, fallback)
        log_evidence = self.log_evidence(used, key, frames)
        return jnp.where(possible, log_prior, -jnp.inf), jnp.where(possible, log_evidence, -jnp.inf)


class _Chains(NamedTuple):
    """Current parameters of C chains, ``[C, d]``, their log prior and log evidence, ``[C]``."""

    place: jax.Array
    log_prior: jax.Array
    log_evidence: jax.Array


class _Walk(NamedTuple):
    """The random walk shared by all chains: moments of past positions, and a scale factor."""

    mean: jax.Array
    covariance: jax.Array
    log_scale: jax.Array


@partial(jax.jit, static_argnums=0)
def _pilot(model, keys, frames, parameters):
    return jax.lax.map(lambda key: model.log_evidence(parameters, key, frames), keys, batch_size=16)


def _with_chosen_number(model: _Model, key: jax.Array, frames: Any, parameters: Any) -> _Model:
    """Choose the number of particles for a variance of 1, which is about proportional to 1 / N."""
    for attempt in range(4):
        keys = jax.random.split(jax.random.fold_in(key, attempt), _PILOT_RUNS)
        log_evidences = np.asarray(_pilot(model, keys, frames, parameters))
        variance = float(np.var(log_evidences, ddof=1)) if np.isfinite(log_evidences).all() else 16
        if 0.7 < variance < 1.4:
            return model
        wanted = math.log2(max(16, model.num_particles * min(variance, 16)))
        number = round(2 ** (math.ceil(2 * wanted) / 2))  # few values: each needs compiling
        if np.isneginf(log_evidences).all() and attempt == 3:
            raise InputError(
                f"the parameters {parameters!r:.200} cannot explain the frames with "
                f"{model.num_particles} particles; start elsewhere, or give num_particles."
            )
        model = model._replace(num_particles=number)
        if variance < 4:  # above it, 1 / N is too rough: measure again
            return model
    return model


@partial(jax.jit, static_argnums=0)
def _advance(model, key, frames, initial, chains, walk, rates):
    """Advance the chains by S steps and adapt the walk at ``rates`` ``[S]``; 0 does not adapt.

    Also returns the chains after each step and the accepted moves, ``[S, C, ...]``.
    """
    unravel = ravel_pytree(initial)[1]
    num_chains, size = chains.place.shape

    def step(carry, item):
        chains, walk = carry
        rate, key = item
        move_key, accept_key, *keys = jax.random.split(key, 2 + num_chains)
        root = jnp.linalg.cholesky(walk.covariance + 1e-8 * jnp.diag(jnp.diag(walk.covariance)))
        moves = jnp.exp(walk.log_scale) * jax.random.normal(move_key, (num_chains, size)) @ root.T
        place = chains.place + moves
        proposed = _Chains(
            place,
            *jax.vmap(model.target, in_axes=(0, 0, None, 0))(
                jax.vmap(unravel)(place), jnp.stack(keys), frames, jax.vmap(unravel)(chains.place)
            ),
        )
        after = proposed.log_prior + proposed.log_evidence
        possible = after > -jnp.inf
        before = chains.log_prior + chains.log_evidence
        chance = jnp.where(possible, jnp.exp(jnp.where(possible, after - before, 0)), 0)
        chance = jnp.minimum(chance, 1)
        accepted = jax.random.uniform(accept_key, (num_chains,)) < chance
        chains = _Chains(
            jnp.where(accepted[:, None], place, chains.place),
            *(jnp.where(accepted, *both) for both in zip(proposed[1:], chains[1:], strict=True)),
        )
        mean = walk.mean + rate * (jnp.mean(chains.place, 0) - walk.mean)
        offset = chains.place - mean
        covariance = walk.covariance + rate * (offset.T @ offset / num_chains - walk.covariance)
        log_scale = walk.log_scale + rate * (jnp.mean(chance) - _ACCEPTANCE)
        return (chains, _Walk(mean, covariance, log_scale)), (chains, accepted)

    rates = jnp.asarray(rates, walk.log_scale.dtype)
    items = (rates, jax.random.split(key, len(rates)))
    carry, kept = jax.lax.scan(step, (chains, walk), items)
    return *carry, kept
