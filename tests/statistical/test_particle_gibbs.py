"""Particle Gibbs leaves trajectories and frames distributed as they were (Geweke 2004)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, TREE, WRONG, problem
from proposed import Bad

from jaxpf import ordering
from jaxpf.proposals import Mixture
from jaxpf.resampling.schemes import BuiltIn
from jaxpf.smoothing import gibbs

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

CHAINS, SWEEPS, FRAMES = 10_000, 3, 4
#: Motion of second order, and a tree under a likelihood that does not factor.
CASES = {
    "second order": lambda: problem((-1, -1), transition=1.4, lag=-0.8, initial_scale=1.0),
    "tree": lambda: problem(TREE, initial_scale=1.0, correlation=0.6),
    "proposal": lambda: problem((-1, -1), initial_scale=1.0),
}


def drift(case):
    """z-scores of how far moments go off in sweeps that begin at draws of the joint distribution.

    A chain takes turns: a trajectory given the frames by one sweep of four particles, and frames
    given the trajectory.  Every moment of the trajectory stays what it was.
    """
    exact = CASES[case]()
    size = len(exact.parents)
    settings = {"num_particles": 4, "resampling": "multinomial"}
    settings |= {"proposal": Mixture(Bad())} if case == "proposal" else {}
    its = exact.tracker(ordering.ps(range(size)), **settings)
    noise = np.linalg.cholesky(getattr(exact.likelihood, "covariance", np.eye(size)))
    looks_back = exact.dynamics.lag is not None

    def trajectory(key):
        def move(lagged, key):
            new = []  # parents stand before their parts
            for part, parent in enumerate(exact.parents):
                hangs_on = new[parent] if parent >= 0 else jnp.zeros(1)
                old = lagged[0, part], lagged[1, part], hangs_on
                new.append(
                    exact.dynamics.propagate(jax.random.fold_in(key, part), jnp.array(part), *old)
                )
            return jnp.stack([jnp.stack(new), lagged[0]]), jnp.stack(new)

        start_key, key = jax.random.split(key)
        start = exact.initial(start_key)
        keys = jax.random.split(key, FRAMES)
        return jnp.concatenate([start[None], jax.lax.scan(move, jnp.stack([start] * 2), keys)[1]])

    def frames(key, path):
        seen = path[1:, :, 0] + jax.random.normal(key, (FRAMES, size)) @ noise.T
        return seen.reshape(-1, *exact.frames.shape[1:])

    def chain(key):
        start_key, key = jax.random.split(key)
        start = trajectory(start_key)

        def turn(path, key):
            frame_key, sweep_key = jax.random.split(key)
            return gibbs.sweep(its, sweep_key, frames(frame_key, path), path, looks_back), None

        end = jax.lax.scan(turn, start, jax.random.split(key, SWEEPS))[0]
        return moments(end) - moments(start)

    def moments(path):
        path = path[..., 0]
        products = [path[1:] ** 2, path[1:] * path[:-1], path[2:] * path[:-2]]
        return jnp.concatenate([product.reshape(-1) for product in products])

    keys = jax.random.split(jax.random.key(1), CHAINS)
    off = np.asarray(jax.jit(lambda keys: jax.lax.map(chain, keys, batch_size=1000))(keys))
    return off.mean(0) / (off.std(0, ddof=1) / CHAINS**0.5)


@pytest.mark.parametrize("case", CASES)
def test_sweeps_leave_the_joint_distribution_as_it_is(case):
    worst = np.abs(drift(case)).max()
    print(f"{case}: |z| up to {worst:.2f}")
    assert worst < LIMIT


def test_a_reference_that_is_not_kept_is_found_out(monkeypatch):
    monkeypatch.setattr(gibbs._KeepsFirst, "within", BuiltIn.within)
    assert np.abs(drift("second order")).max() > WRONG


def test_a_reference_that_is_proposed_anew_is_found_out(monkeypatch):
    monkeypatch.delattr(gibbs._HoldsFirst, "propose_all")
    assert np.abs(drift("proposal")).max() > WRONG


def test_ancestors_that_forget_the_frame_after_next_are_found_out(monkeypatch):
    right = gibbs.log_densities

    def forgetful(tracker, here, drawn, parts, parents, frames_left, time):
        return right(tracker, here, drawn, parts, parents, jnp.minimum(frames_left, 1), time)

    monkeypatch.setattr(gibbs, "log_densities", forgetful)
    assert np.abs(drift("second order")).max() > WRONG
