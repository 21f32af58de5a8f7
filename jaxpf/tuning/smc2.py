"""Posterior of a model's parameters frame by frame: SMC^2 (Chopin, Jacob & Papaspiliopoulos 2013).

Weighted parameters, each with a particle filter of its own, take in one frame after the other.
When few parameters carry the weight, they are resampled and moved by particle marginal
Metropolis-Hastings, whose filters run again from the first frame.  The target is the exact
posterior for any number of state particles.  With filters whose evidence is exact this is IBIS
(Chopin 2002).
"""

import os
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.flatten_util import ravel_pytree

from jaxpf.contract.logs import add_exactly, multiplied
from jaxpf.contract.numbers import check_number, check_whole
from jaxpf.contract.refusals import biased_evidence, poisoned
from jaxpf.contract.state import moments
from jaxpf.lowering.programs import compiled
from jaxpf.resampling.weighted import ancestors
from jaxpf.running import missing_frames, runs
from jaxpf.running.frames import as_arrays, num_frames
from jaxpf.tuning.checkpoint import LongScans, Progress
from jaxpf.tuning.metropolis import Filters
from jaxpf.tuning.objectives import keep_log_evidence


class Online(NamedTuple):
    """Parameters' posterior after every frame, by M weighted draws.

    Attributes:
        parameters: pytree of the draws after the last frame; leaves ``[M, ...]``.
        log_weights: ``[M]``, their normalised log-weights.
        mean: pytree ``[T, ...]``, posterior mean given the frames so far.
        spread: pytree ``[T, ...]``, posterior standard deviation given the frames so far.
        log_evidence: ``[T]``, each frame's factor in an estimate of the evidence of the model, with
            the parameters integrated out: consistent as M grows, but not exactly unbiased, since
            the moves adapt to the draws (Beskos, Jasra, Kantas & Thiery 2016).
        ess: ``[T]``, effective number of draws, before a move.
        acceptance: ``[T]``, share of accepted moves; NaN in frames without.
    """

    parameters: Any
    log_weights: jax.Array
    mean: Any
    spread: Any
    log_evidence: jax.Array
    ess: jax.Array
    acceptance: jax.Array


def smc2(
    build: Callable[[Any], Any],
    log_prior: Callable[[Any], jax.Array],
    draw_prior: Callable[[jax.Array], Any],
    key: jax.Array,
    frames: Any,
    *,
    num_draws: int = 256,
    num_particles: int | None = None,
    num_moves: int = 3,
    ess_threshold: float = 0.5,
    observed: Any = None,
    inputs: Any = None,
    progress: Progress | None = None,
    folder: str | os.PathLike[str] | None = None,
) -> Online:
    """Draw parameters from their posterior after every frame.

    Source: Chopin, Jacob & Papaspiliopoulos 2013.

    Example::

        online = jaxpf.tuning.smc2(build, log_prior, draw_prior, key, y)
        online.mean["a"], online.spread["a"]  # [T], given the frames so far

    Args:
        build: as for ``jaxpf.pmmh``.
        log_prior: parameters -> log prior density ``[]``, up to a constant.
        draw_prior: key -> parameters, a pytree of floats, from the same prior.
        key: random key.
        frames: as for ``jaxpf.run``.
        num_draws: M, number of draws of parameters.
        num_particles: N of every filter; default the trackers' own.
        num_moves: Metropolis-Hastings moves after a resampling.
        ess_threshold: resample and move if the effective number of draws is below this share.
        observed: as for ``jaxpf.run``.
        inputs: as for ``jaxpf.run``.
        progress: called with the number of frames done, and of all.
        folder: as for ``jaxpf.pmmh``.

    Returns:
        M weighted draws, their moments after every frame, and the evidence.

    Raises:
        InputError: a number out of range, a biased evidence, or a folder that was begun with other
            data or settings.
    """
    for name, value in (("num_draws", num_draws), ("num_moves", num_moves)):
        check_whole(name, value)
    check_number("ess_threshold", ess_threshold, least=0, most=1)
    key = runs.as_key(key)
    start = draw_prior(jax.random.clone(key))  # for its form alone
    tracker = build(start)
    refuse = biased_evidence(tracker, "smc2", "another filter")
    inputs = as_arrays(inputs)
    marked, frames = runs.ready(tracker, frames, observed, inputs)
    filters = Filters(build, log_prior, isinstance(marked, missing_frames.WithGaps), num_particles)
    settings = num_draws, num_moves, float(ess_threshold)
    asked: dict[str, Any] = {"num_draws": num_draws, "num_moves": num_moves, "key": key}
    asked |= {"num_particles": num_particles, "ess_threshold": ess_threshold, "start": start}
    asked |= {"frames": (frames, inputs), "observed": observed}
    scans = LongScans(progress, folder, num_frames(frames), asked)
    prior_key, filter_key, move_key = jax.random.split(key, 3)
    first = _begun(filters, draw_prior, num_draws, (prior_key, filter_key), inputs)
    times = jnp.arange(num_frames(frames))
    items = times, jax.random.split(move_key, len(times))
    take = partial(_take, filters, settings, start, frames, inputs)
    (draws, log_weights), kept = scans.scan("frames", take, first, items)
    parameters = jax.vmap(ravel_pytree(start)[1])(draws.place)
    return poisoned(refuse, Online(parameters, log_weights, *kept))


class _Draws(NamedTuple):
    """Parameters ``[M, d]``, their filters' keys and states, and log evidence so far ``[M, 2]``.

    The latter are totals of ``add_exactly``, since moves compare them.
    """

    place: jax.Array
    keys: jax.Array
    states: Any
    log_evidence: jax.Array


@partial(compiled, static_argnums=(0, 1, 2))
def _begun(filters, draw_prior, num_draws, keys, inputs):
    """Draws from the prior before the first frame, and their equal log-weights."""
    first = jax.vmap(draw_prior)(jax.random.split(keys[0], num_draws))
    place = jax.vmap(lambda x: ravel_pytree(x)[0])(first)
    keys = jax.random.split(keys[1], num_draws)
    states = jax.vmap(lambda x, key: runs.init(filters.tracker(x, inputs), key))(first, keys)
    draws = _Draws(place, keys, states, jnp.zeros((num_draws, 2), place.dtype))
    return draws, jnp.full(num_draws, -np.log(num_draws), place.dtype)


@partial(compiled, static_argnums=(0, 1))
def _take(filters, settings, start, frames, inputs, carry, items):
    """Take in the frames of ``items``, their times and keys; ``start`` is like one draw."""
    num_draws, num_moves, threshold = settings
    unravel = ravel_pytree(start)[1]

    def tracker_of(place):
        return filters.tracker(unravel(place), inputs)

    def advance(place, key, state, log_evidence, time):
        frame = jax.tree.map(lambda x: jnp.asarray(x)[time], frames)
        step = runs.one_run(tracker_of(place), key, keep_log_evidence)
        state, increment = step(state, (time, frame))
        return state, add_exactly(log_evidence, increment), increment

    def from_start(place, key, time):
        """The state and the log evidence of all frames up to this one."""
        state = runs.init(tracker_of(place), key)
        zero = jnp.zeros(2, place.dtype)
        return lax.fori_loop(
            0, time + 1, lambda t, old: advance(place, key, old[0], old[1], t)[:2], (state, zero)
        )

    def moved(key, draws, time, root):
        noise_key, filter_key, accept_key = jax.random.split(key, 3)
        new = draws.place + jax.random.normal(noise_key, draws.place.shape) @ root.T
        keys = jax.random.split(filter_key, num_draws)
        proposed = _Draws(new, keys, *jax.vmap(from_start, (0, 0, None))(new, keys, time))
        prior = jax.vmap(lambda x: filters.log_prior(unravel(x)))
        change = prior(new) - prior(draws.place)
        change += jnp.sum(proposed.log_evidence - draws.log_evidence, axis=1)
        accepted = jnp.log(jax.random.uniform(accept_key, (num_draws,))) < change  # not if NaN

        def chosen(new, old):
            if jnp.issubdtype(new.dtype, jax.dtypes.prng_key):
                return jnp.where(accepted, new, old)
            return jnp.where(accepted.reshape(-1, *[1] * (new.ndim - 1)), new, old)

        return jax.tree.map(chosen, proposed, draws), jnp.mean(accepted, dtype=new.dtype)

    def rejuvenated(key, draws, log_weights, time):
        select_key, *keys = jax.random.split(key, 1 + num_moves)
        mean = jnp.exp(log_weights) @ draws.place
        offset = draws.place - mean
        covariance = (offset.T * jnp.exp(log_weights)) @ offset
        size = len(covariance)
        jitter = 1e-6 * jnp.diag(jnp.diag(covariance)) + 1e-12 * jnp.eye(size)
        root = 2.38 / size**0.5 * jnp.linalg.cholesky(covariance + jitter)
        chosen = ancestors(select_key, log_weights)
        draws = jax.tree.map(lambda x: x[chosen], draws)
        move = partial(moved, time=time, root=root)
        draws, shares = lax.scan(lambda draws, key: move(key, draws), draws, jnp.stack(keys))
        return draws, jnp.full_like(log_weights, -np.log(num_draws)), jnp.mean(shares)

    def take(carry, item):
        draws, log_weights = carry
        time, key = item
        states, log_evidence, increments = jax.vmap(advance, (0, 0, 0, 0, None))(
            draws.place, draws.keys, draws.states, draws.log_evidence, time
        )
        draws = draws._replace(states=states, log_evidence=log_evidence)
        log_weights, total = multiplied(log_weights, increments)
        weights = jnp.exp(log_weights)
        ess = 1 / (weights @ weights)
        mean, spread = moments(draws.place.T, weights, jnp.matmul)
        draws, log_weights, acceptance = lax.cond(
            ess < threshold * num_draws,
            partial(rejuvenated, time=time),
            lambda _, draws, log_weights: (draws, log_weights, jnp.full((), jnp.nan, ess.dtype)),
            *(key, draws, log_weights),
        )
        return (draws, log_weights), (unravel(mean), unravel(spread), total, ess, acceptance)

    return lax.scan(take, carry, items)
