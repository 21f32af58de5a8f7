"""Posterior of a model's parameters by particle marginal Metropolis-Hastings.

A Metropolis chain whose likelihood is a particle filter's unbiased estimate of the evidence has the
exact posterior as its law (Andrieu, Doucet & Holenstein 2010), whatever the number of particles.
That number only decides how well it mixes: best where the log evidence has a variance of about 1
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
from jaxpf.errors import InputError
from jaxpf.pytree import is_concrete, pytree_dataclass, static_field
from jaxpf.running import gaps
from jaxpf.tuning.objectives import keep_log_evidence

#: Share of accepted moves that warm-up aims at; noise in the evidence alone rejects half of them.
_ACCEPTANCE = 0.2
#: Runs from which the variance of the log evidence is measured.
_PILOT_RUNS = 64


@pytree_dataclass
class Posterior:
    """Draws of parameters from C chains of S draws, after warm-up.

    Attributes:
        parameters: the pytree of the parameters; leaves ``[C, S, ...]``.
        log_evidence: ``[C, S]``, the estimate that each draw was accepted with.
        log_prior: ``[C, S]``.
        accepted: ``[C, S]`` bool, whether the chain moved.
        num_particles: of the filters.
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
        statistics = {
            "lp": self.log_evidence + self.log_prior,
            "log_evidence": self.log_evidence,
            "accepted": self.accepted,
        }
        named = {
            jax.tree_util.keystr(path, simple=True, separator=".") or "parameter": np.asarray(leaf)
            for path, leaf in leaves
        }
        statistics = {name: np.asarray(value) for name, value in statistics.items()}
        attributes = {"inference_library": "jaxpf", "num_particles": self.num_particles}
        return arviz_base.from_dict(
            {"posterior": named, "sample_stats": statistics}, attrs={"/": attributes}
        )


class _Chains(NamedTuple):
    """Where C chains stand, ``[C, d]``, and their log prior and log evidence, ``[C]``."""

    place: jax.Array
    log_prior: jax.Array
    log_evidence: jax.Array


class _Walk(NamedTuple):
    """The random walk that all chains share: moments of the places so far, and a factor."""

    mean: jax.Array
    covariance: jax.Array
    log_scale: jax.Array


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

    All chains advance together.  They share a Gaussian random walk, whose covariance and scale are
    adapted during warm-up and fixed afterwards.  Pass named functions: new ones compile anew.

    Args:
        build: parameters -> tracker with an unbiased ``log_evidence``, such as
            ``jaxpf.state_space(..., parameters=p)``.
        log_prior: parameters -> log prior density ``[]``, up to a constant; -inf outside of its
            support, where no tracker is run.
        key: a random key.
        frames: as for ``jaxpf.run``.
        initial: parameters to start near, any pytree of floats.
        num_draws: S, kept of each chain.
        num_warmup: draws before, which are discarded.
        num_chains: C.
        num_particles: of the trackers; by default chosen twice, at the start and half-way through
            warm-up, so that the log evidence has a variance of about 1.  Inside a user's ``jit``
            the default is that of the trackers.
        observed: as for ``jaxpf.run``.

    Raises:
        InputError: a number below 1; parameters that are no floats; a start that the prior excludes
            or that cannot explain the frames.
    """
    for name, value in (
        ("num_draws", num_draws), ("num_warmup", num_warmup), ("num_chains", num_chains)
    ):  # fmt: skip
        if value < 1:
            raise InputError(f"{name}={value} must be at least 1.")
    if not all(jnp.issubdtype(jnp.result_type(x), jnp.floating) for x in jax.tree.leaves(initial)):
        raise InputError(f"initial={initial!r} must hold floats alone; write 1.0 for 1.")
    initial = jax.tree.map(lambda x: jnp.asarray(x, float), initial)
    tracker = build(initial)
    running.check_run(tracker, frames)
    marked, frames = gaps.marked(tracker, frames, observed)
    is_known = is_concrete(key, frames, initial, tracker)
    if is_known and not np.isfinite(log_prior(initial)):
        raise InputError(f"the prior excludes the start {initial!r:.200}; start inside of it.")
    model = _Model(build, log_prior, isinstance(marked, gaps.WithGaps), num_particles)
    keys = jax.random.split(running.as_key(key), 6)
    chosen = is_known and num_particles is None
    if chosen:
        model = model.with_chosen_number(keys[0], frames, initial, tracker.num_particles)
    flat = ravel_pytree(initial)[0]
    spread = 0.1 * jnp.maximum(jnp.abs(flat), 0.1)
    walk = _Walk(flat, jnp.diag(spread**2), jnp.log(2.38 / math.sqrt(flat.size)))
    chains = _start(model, keys[1], frames, initial, spread, num_chains)
    first = max(1, num_warmup // 2)
    chains, walk, _ = _advance(model, keys[2], frames, initial, chains, walk, first, 1)
    if chosen:
        middle = ravel_pytree(initial)[1](walk.mean)
        if np.isfinite(log_prior(middle)):
            model = model.with_chosen_number(keys[3], frames, middle, model.num_particles)
    if num_warmup > first:
        rest = num_warmup - first
        chains, walk, _ = _advance(model, keys[4], frames, initial, chains, walk, rest, 1 + first)
    kept = _advance(model, keys[5], frames, initial, chains, walk, num_draws, None)[2]
    parameters, states, accepted = kept
    return Posterior(
        parameters=parameters,
        log_evidence=states.log_evidence,
        log_prior=states.log_prior,
        accepted=accepted,
        num_particles=model.num_particles or tracker.num_particles,
    )


class _Model(NamedTuple):
    """What a chain's target is made of; static."""

    build: Callable
    log_prior: Callable
    has_gaps: bool
    num_particles: int | None

    def log_evidence(self, parameters: Any, key: jax.Array, frames: Any) -> jax.Array:
        """An estimate ``[]``; -inf where it is no number."""
        tracker = self.build(parameters)
        if self.num_particles is not None:
            tracker = dataclasses.replace(tracker, num_particles=self.num_particles)
        if self.has_gaps:
            tracker = gaps.WithGaps(tracker)
        total = jnp.sum(running.run_compiled(tracker, key, frames, keep_log_evidence)[1])
        return jnp.where(jnp.isnan(total), -jnp.inf, total)

    def with_chosen_number(
        self, key: jax.Array, frames: Any, parameters: Any, number: int
    ) -> "_Model":
        """The number of particles for a variance of 1, which is proportional to 1 / N."""
        model = self._replace(num_particles=number)
        for attempt in range(4):
            keys = jax.random.split(jax.random.fold_in(key, attempt), _PILOT_RUNS)
            log_evidences = np.asarray(_pilot(model, keys, frames, parameters))
            number = model.num_particles or 1
            if not np.isfinite(log_evidences).all():
                if attempt == 3 and not np.isfinite(log_evidences).any():
                    raise InputError(
                        f"the parameters {parameters!r:.200} cannot explain the frames with "
                        f"{number} particles; start elsewhere, or give num_particles."
                    )
                model = model._replace(num_particles=4 * number)
                continue
            variance = float(np.var(log_evidences, ddof=1))
            if 0.7 < variance < 1.4:
                break
            model = model._replace(num_particles=max(16, math.ceil(number * min(variance, 16))))
            if variance < 4:  # else the law is rough: measure again
                break
        return model


@partial(jax.jit, static_argnums=0)
def _pilot(model, keys, frames, parameters):
    return jax.lax.map(lambda key: model.log_evidence(parameters, key, frames), keys, batch_size=16)


def _targets(model, unravel, key, frames, place, fallback) -> tuple[jax.Array, jax.Array]:
    """Log prior and log evidence ``[C]`` at ``place`` ``[C, d]``."""

    def of_one(key, place, fallback):
        log_prior = model.log_prior(unravel(place))
        log_prior = jnp.where(jnp.isnan(log_prior), -jnp.inf, log_prior)
        possible = ~jnp.isneginf(log_prior)
        # Where the prior excludes a place, the tracker runs at one that it does not.
        place = jnp.where(possible, place, fallback)
        log_evidence = model.log_evidence(unravel(place), key, frames)
        return log_prior, jnp.where(possible, log_evidence, -jnp.inf)

    return jax.vmap(of_one)(jax.random.split(key, len(place)), place, fallback)


@partial(jax.jit, static_argnums=(0, 5))
def _start(model, key, frames, initial, spread, num_chains) -> _Chains:
    flat, unravel = ravel_pytree(initial)
    noise_key, key = jax.random.split(key)
    place = flat + spread * jax.random.normal(noise_key, (num_chains, flat.size))
    possible = ~jnp.isneginf(jax.vmap(lambda z: model.log_prior(unravel(z)))(place))
    place = jnp.where(possible[:, None], place, flat)
    return _Chains(place, *_targets(model, unravel, key, frames, place, place))


@partial(jax.jit, static_argnums=(0, 6))
def _advance(model, key, frames, initial, chains, walk, num_steps, first):
    """Chains after some steps; adapts the walk, from step number ``first`` on, unless it is None.

    Returns:
        The chains, the walk, and what is kept: parameters, chains and moves, ``[C, S, ...]``.
    """
    unravel = ravel_pytree(initial)[1]
    num_chains, size = chains.place.shape

    def step(carry, item):
        chains, walk = carry
        key, number = item
        move_key, key, accept_key = jax.random.split(key, 3)
        root = jnp.linalg.cholesky(walk.covariance + 1e-8 * jnp.diag(jnp.diag(walk.covariance)))
        moves = jnp.exp(walk.log_scale) * jax.random.normal(move_key, (num_chains, size)) @ root.T
        place = chains.place + moves
        proposed = _Chains(place, *_targets(model, unravel, key, frames, place, chains.place))
        after = proposed.log_prior + proposed.log_evidence
        before = chains.log_prior + chains.log_evidence
        possible = ~jnp.isneginf(after)
        log_ratio = jnp.where(possible, jnp.where(possible, after, 0.0) - before, -jnp.inf)
        chance = jnp.exp(jnp.minimum(log_ratio, 0.0))
        accepted = jax.random.uniform(accept_key, (num_chains,)) < chance
        chains = jax.tree.map(
            lambda new, old: jnp.where(accepted.reshape(-1, *[1] * (new.ndim - 1)), new, old),
            proposed,
            chains,
        )
        if first is not None:
            rate = (number + 1.0) ** -0.6
            mean = walk.mean + rate * (jnp.mean(chains.place, 0) - walk.mean)
            offset = chains.place - mean
            covariance = walk.covariance + rate * (offset.T @ offset / num_chains - walk.covariance)
            log_scale = walk.log_scale + rate * (jnp.mean(chance) - _ACCEPTANCE)
            walk = _Walk(mean, covariance, log_scale)
        return (chains, walk), (chains, accepted)

    numbers = jnp.arange(num_steps) + (0 if first is None else first)
    items = (jax.random.split(key, num_steps), numbers)
    (chains, walk), (kept, accepted) = jax.lax.scan(step, (chains, walk), items)
    kept, accepted = jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), (kept, accepted))
    return chains, walk, (jax.vmap(jax.vmap(unravel))(kept.place), kept, accepted)
