"""Posterior of a model's parameters by particle marginal Metropolis-Hastings.

The likelihood is a particle filter's unbiased estimate of the evidence.  The chain then targets the
exact posterior for any number of particles (Andrieu, Doucet & Holenstein 2010).  More particles mix
better and cost more: the time per effective draw is near its least where the log evidence has a
variance of about 1 to 3 (Doucet, Pitt, Deligiannidis & Kohn 2015).

With several blocks, a move redraws the random numbers of one block of frames alone (Tran, Kohn,
Quiroz & Villani 2016), so that most noise is common to the current and the proposed evidence.  This
is a symmetric move of the random numbers, so the posterior stays exact.
"""

import dataclasses
import math
import os
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from jaxpf.contract import calls
from jaxpf.contract.calls import at_frame, optional, with_inputs
from jaxpf.contract.errors import InputError
from jaxpf.contract.logs import sum_evenly
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.refusals import biased_evidence, poisoned
from jaxpf.contract.state import Summary
from jaxpf.contract.types import TrackerLike
from jaxpf.lowering import platform
from jaxpf.lowering.programs import compiled
from jaxpf.running import missing_frames, runs
from jaxpf.running.frames import as_arrays, num_frames
from jaxpf.smoothing.backward import draw_paths, key_of
from jaxpf.smoothing.checks import check_genealogy
from jaxpf.tuning.checkpoint import LongScans, Progress
from jaxpf.tuning.objectives import keep_log_evidence
from jaxpf.tuning.posterior import Posterior

#: Acceptance rate that warm-up targets; noise in the evidence alone rejects half of the moves.
_ACCEPTANCE = 0.2
#: Initial step of the random walk, relative to the parameters.
_FIRST_STEP = 0.1
#: Largest count of draws, chains, particles and blocks.
_MOST = 10**7
#: Number of pilot runs that estimate the variance of the log evidence.
_PILOT_RUNS = 64


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
    blocks: int = 1,
    observed: Any = None,
    paths: bool = False,
    inputs: Any = None,
    biased: bool = False,
    progress: Progress | None = None,
    folder: str | os.PathLike[str] | None = None,
) -> Posterior:
    """Draw parameters from their posterior given frames.

    All chains advance together.  They share a Gaussian random walk whose covariance and scale are
    adapted during warm-up and fixed afterwards.  Pass named functions: each new function
    recompiles.

    Example::

        def build(p):
            return jaxpf.state_space(
                initial=initial, transition=transition, log_likelihood=log_likelihood, parameters=p
            )

        def log_prior(p):
            return jnp.where(jnp.abs(p["a"]) < 1, 0.0, -jnp.inf)

        posterior = jaxpf.pmmh(build, log_prior, jax.random.key(0), y, {"a": 0.5})
        posterior.parameters["a"].mean()

    Args:
        build: parameters -> tracker, such as ``jaxpf.state_space(..., parameters=p)``, whose
            estimate of the marginal likelihood, ``exp(log_evidence.sum())``, is unbiased.
        log_prior: parameters -> log prior density ``[]``, up to a constant; -inf outside its
            support.
        key: random key.
        frames: as for ``jaxpf.run``.
        initial: starting values, any pytree of numbers; chains start near them.
        num_draws: S, draws kept per chain.
        num_warmup: warm-up draws per chain, which are discarded.
        num_chains: C.
        num_particles: number of particles of the trackers.  By default it is chosen half-way
            through warm-up, so that noise gives the change of the log evidence in a move a variance
            of about 2, that is 1 for each end.  Inside a user's ``jit`` the default is the
            trackers' own number.
        blocks: number of blocks of frames, of which a move redraws the random numbers of one, in
            turn; 10 may need fewer particles than 1, which redraws all.
        observed: as for ``jaxpf.run``.
        paths: whether to keep a trajectory of the states with each draw of parameters; the pairs
            are draws from their joint posterior.  Missing frames at the end of ``frames`` are
            forecast.  If the model draws observations, their predictive draws are kept too.
        inputs: as for ``jaxpf.run``.
        biased: whether a biased evidence may serve; the draws are then not of the posterior.
        progress: called with the number of moves done, and of all.
        folder: keeps finished moves; the same call goes on from there after an interruption, and
            returns the same draws.  One folder for each model: functions are not compared.

    Returns:
        A ``jaxpf.tuning.posterior.Posterior``: draws of parameters from C chains, S each.

    Raises:
        InputError: a number is below 1, the evidence is biased, the start is excluded by the prior
            or cannot explain the frames, or the folder was begun with other data or settings.
    """
    counts = {"num_draws": num_draws, "num_warmup": num_warmup, "num_chains": num_chains}
    counts |= {"blocks": blocks, "num_particles": 1 if num_particles is None else num_particles}
    for name, value in counts.items():
        check_whole(name, value, most=_MOST)
    initial = jax.tree.map(lambda x: jnp.asarray(x, float), initial)
    tracker, prior = build(initial), log_prior(initial)
    refuse = None
    if not biased:
        refuse = biased_evidence(tracker, "pmmh", "biased=True for draws that are not exact")
    inputs = as_arrays(inputs)
    marked, frames = runs.ready(tracker, frames, observed, inputs)
    if paths:
        check_genealogy(tracker)
    frames = frames, inputs
    is_known = is_concrete(key, frames, initial, tracker)
    if is_known and not np.isfinite(prior):
        raise InputError(f"the prior excludes the start {initial!r:.200}; start inside of it.")
    number = num_particles or tracker.num_particles
    model = Filters(build, log_prior, isinstance(marked, missing_frames.WithGaps), number, paths)
    choice_key, start_key, *keys = jax.random.split(runs.as_key(key), 4)
    start, unravel = ravel_pytree(initial)
    spread = _FIRST_STEP * jnp.maximum(jnp.abs(start), _FIRST_STEP)
    walk = _Walk(start, jnp.diag(spread**2), jnp.log(2.38 / math.sqrt(start.size)))
    place = jnp.tile(start, (num_chains, 1))
    unknown = jnp.full((num_chains, num_frames(frames)), -jnp.inf)  # accepts the first move
    chain_keys = jax.random.split(start_key, (num_chains, blocks))
    path = None
    if paths:
        shaped = jax.eval_shape(partial(model.run, frames=frames), initial, chain_keys[0])[1]
        path = jnp.zeros((num_chains, *shaped.shape), shaped.dtype)
    chains = _Chains(place, unknown[:, 0], unknown, chain_keys, path)
    steps = np.arange(num_warmup + num_draws)
    scans = LongScans(
        progress, folder, len(steps),
        counts | {"num_particles": number, "paths": paths, "key": key, "frames": frames,
                  "observed": observed, "initial": initial},
    )  # fmt: skip
    rates = np.where(steps < num_warmup, (steps + 2.0) ** -0.6, 0.0)
    if is_known and num_particles is None:
        half = -(-num_warmup // 2)
        (chains, walk), _ = _advanced(
            scans, model, keys[0], frames, initial, chains, walk, rates[:half]
        )
        number = _chosen_number(model, number, choice_key, frames, initial, chains)
        model = model._replace(num_particles=number)
        rates = rates[half:]
    kept = _advanced(scans, model, keys[1], frames, initial, chains, walk, rates)[1]
    kept = jax.tree.map(lambda x: jnp.swapaxes(x[-num_draws:], 0, 1), kept)
    places, priors, evidences, accepted, path = kept
    if is_known and np.isneginf(evidences[:, -1]).any():  # a chain accepted no move
        raise InputError(
            f"the parameters {initial!r:.200} cannot explain the frames with "
            f"{number} particles; start elsewhere, or give more particles."
        )
    parameters = jax.vmap(jax.vmap(unravel))(places)
    observations = None
    if paths and optional(tracker.likelihood, "sample") and not tracker.sees_previous:
        sample_key = key_of(runs.as_key(key))
        observations = _observed(build, sample_key, parameters, path, inputs)
    path = calls.states(tracker, path) if paths else None
    drawn = Posterior(parameters, evidences, priors, accepted, number, path, observations)
    return poisoned(refuse, drawn)


class Filters(NamedTuple):
    """Static definition of the filters, and with ``log_prior`` of the parameters' posterior."""

    build: Callable
    log_prior: Callable
    has_gaps: bool
    num_particles: int | None
    has_paths: bool = False

    def tracker(self, parameters: Any, inputs: Any) -> TrackerLike:
        """Return the filter of some parameters."""
        changes: dict[str, Any] = {"keep_ancestors": True} if self.has_paths else {}
        if self.num_particles is not None:
            changes["num_particles"] = self.num_particles
        tracker = self.build(parameters)
        if changes:  # else it may be any class
            tracker = dataclasses.replace(tracker, **changes)
        tracker = with_inputs(tracker, inputs)
        return missing_frames.WithGaps(tracker) if self.has_gaps else tracker

    def increments(self, parameters: Any, keys: jax.Array, frames: Any) -> jax.Array:
        """Estimate the frames' log evidence ``[T]``, with a random key for each block of them."""
        return self._replace(has_paths=False).run(parameters, keys, frames)[0]

    def run(self, parameters: Any, keys: jax.Array, frames: Any) -> tuple[jax.Array, Any]:
        """Return ``increments``, and a draw of the states ``[T, P, D]``; None without paths."""
        frames, inputs = frames
        tracker = self.tracker(parameters, inputs)
        record = _keep_ancestors if self.has_paths else keep_log_evidence
        times = np.arange(num_frames(frames))

        def step(state, item):
            key, *item = item
            return runs.one_run(tracker, key, record)(state, item)

        items = keys[times * len(keys) // len(times)], times, frames
        state, kept = jax.lax.scan(step, runs.init(tracker, keys[0]), items)
        if not self.has_paths:
            return kept, None
        increments, *ancestry = kept
        path = draw_paths(key_of(keys[0]), *ancestry, state.log_weights, 1)[0]
        halves = 2 if self.build(parameters).sees_previous else 1
        return increments, path[..., : path.shape[-1] // halves]


def _keep_ancestors(state: Any, summary: Summary) -> Any:
    return summary.log_evidence, state.lagged[0], state.sources


@partial(compiled, static_argnums=0)
def _observed(build, key, parameters, path, inputs):
    """Draw observations ``[C, S, T, ...]`` given parameters and states ``[C, S, T, P, D]``."""

    def of_draw(key, parameters, path):
        tracker = with_inputs(build(parameters), inputs)

        def of_frame(key, time, substates):
            return at_frame(tracker, time).likelihood.sample(key, substates)

        return jax.vmap(of_frame)(jax.random.split(key, len(path)), jnp.arange(len(path)), path)

    keys = jax.random.split(key, path.shape[:2])
    return jax.vmap(jax.vmap(of_draw))(keys, parameters, path)


class _Chains(NamedTuple):
    """Current parameters ``[C, d]``, their log prior ``[C]``, and keys ``[C, B]``.

    ``increments``, ``[C, T]``, are the frames' log evidence: their differences are summed, because
    a difference of sums would be rounded like the sums.  ``path``, ``[C, T, P, D]``, holds states.
    """

    place: jax.Array
    log_prior: jax.Array
    increments: jax.Array
    keys: jax.Array
    path: Any


class _Walk(NamedTuple):
    """The random walk shared by all chains: moments of past positions, and a scale factor."""

    mean: jax.Array
    covariance: jax.Array
    log_scale: jax.Array


def _chosen_number(model, number, key, frames, initial, chains) -> int:
    """Choose the number of particles for a variance of 1, which is about proportional to 1 / N."""
    for pilot_key in jax.random.split(key, 4):
        noise = _noise(model._replace(num_particles=number), pilot_key, frames, initial, chains)
        variance = np.nan_to_num(noise, nan=16, posinf=16)
        if 0.7 < variance < 1.4:
            break
        half_octaves = math.ceil(2 * math.log2(max(8, number * min(variance, 16))))
        number = round(2 ** (half_octaves / 2))  # few: each compiles
    return number


@partial(compiled, static_argnums=0)
def _noise(model, key, frames, initial, chains):
    """Half the variance of the change of log evidence in a move from one chain to another."""
    unravel, num_blocks = ravel_pytree(initial)[1], chains.keys.shape[1]
    keys, redrawn = jax.random.split(key, (2, _PILOT_RUNS, num_blocks))
    pilots = np.arange(_PILOT_RUNS)
    blocks = pilots % num_blocks
    ends = keys, keys.at[pilots, blocks].set(redrawn[pilots, blocks])

    def change(ends):
        places = unravel(chains.place[0]), unravel(chains.place[-1])
        before, after = map(partial(model.increments, frames=frames), places, ends)
        return sum_evenly(after - before)

    together = _PILOT_RUNS if platform.on_accelerator() else 16
    return jnp.var(jax.lax.map(change, ends, batch_size=together), ddof=1) / 2


def _advanced(scans, model, key, frames, initial, chains, walk, rates):
    """Advance the chains by S steps and adapt the walk at ``rates`` ``[S]``; 0 does not adapt.

    Also returns the chains after each step without their keys, and the accepted moves,
    ``[S, C, ...]``.
    """
    num_blocks = chains.keys.shape[1]
    rates = jnp.asarray(rates, walk.log_scale.dtype)
    items = rates, jax.random.split(key, len(rates)), np.arange(len(rates)) % num_blocks
    name = f"{len(rates)}-moves-of-{model.num_particles}-particles"
    advance = partial(_advance, model, frames, initial)
    return scans.scan(name, advance, (chains, walk), items)


@partial(compiled, static_argnums=0)
def _advance(model, frames, initial, carry, items):
    chains, _ = carry
    unravel = ravel_pytree(initial)[1]
    num_chains, size = chains.place.shape

    def target(place, keys):
        parameters = unravel(place)
        return model.log_prior(parameters), *model.run(parameters, keys, frames)

    def step(carry, item):
        chains, walk = carry
        rate, key, block = item
        keys = jax.random.split(key, 2 + num_chains)
        move_key, accept_key = keys[:2]
        root = jnp.linalg.cholesky(walk.covariance + 1e-8 * jnp.diag(jnp.diag(walk.covariance)))
        moves = jnp.exp(walk.log_scale) * jax.random.normal(move_key, (num_chains, size)) @ root.T
        place = chains.place + moves
        keys = chains.keys.at[:, block].set(keys[2:])
        priors, increments, path = jax.vmap(target)(place, keys)
        proposed = _Chains(place, priors, increments, keys, path)
        change = proposed.log_prior - chains.log_prior
        change += sum_evenly(proposed.increments - chains.increments)
        chance = jnp.nan_to_num(jnp.exp(jnp.minimum(change, 0)))  # 0 of NaN
        accepted = jax.random.uniform(accept_key, (num_chains,)) < chance
        chains = jax.tree.map(
            lambda new, old: jnp.where(accepted.reshape(-1, *[1] * (new.ndim - 1)), new, old),
            proposed,
            chains,
        )
        mean = walk.mean + rate * (jnp.mean(chains.place, 0) - walk.mean)
        offset = chains.place - mean
        covariance = walk.covariance + rate * (offset.T @ offset / num_chains - walk.covariance)
        log_scale = walk.log_scale + rate * (jnp.mean(chance) - _ACCEPTANCE)
        return (chains, _Walk(mean, covariance, log_scale)), (
            *chains[:2],
            sum_evenly(chains.increments),
            accepted,
            chains.path,
        )

    return jax.lax.scan(step, carry, items)
