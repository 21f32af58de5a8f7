"""SMC^2, the posterior after every frame; and long jobs, which go on after an interruption."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.special
from autoregression import FRAMES, KEY, START, build, exact_margins, exact_on_grid, log_prior

import jaxpf
from jaxpf import InputError


def draw_prior(key):
    keys = jax.random.split(key)
    a = jax.random.uniform(keys[0], minval=-1.0, maxval=1.0)
    return {"a": a, "s": jax.random.exponential(keys[1]) / 3}


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("ratio", [pytest.param(1.0, marks=pytest.mark.always), 0.0])
def test_smc2_has_the_exact_posterior_and_evidence(ratio):
    """In standard errors over independent runs; moves that ignore the prior are noticed."""
    num_runs = 60

    def prior(p):
        return jnp.where(jnp.isfinite(log_prior(p)), ratio * log_prior(p), -jnp.inf)

    def one(key):
        return jaxpf.tuning.smc2(
            build, prior, draw_prior, key, FRAMES, num_draws=100, num_particles=12
        )

    keys = jax.random.split(KEY, num_runs)
    found = jax.jit(lambda keys: jax.lax.map(one, keys))(keys)
    scores = []
    for name, (grid, exact) in zip("as", exact_margins(), strict=True):
        places = np.interp(np.linspace(0.05, 0.95, 19), exact, grid)
        below = np.asarray(found.parameters[name])[..., None] <= places
        shares = (np.exp(np.asarray(found.log_weights))[..., None] * below).sum(1)
        scores.append((shares.mean(0) - np.linspace(0.05, 0.95, 19)) / shares.std(0, ddof=1))
    a, s, log_posterior, _ = exact_on_grid()
    volume = (a[1] - a[0]) * (s[1] - s[0]) * 0.5 * 3  # of the prior's density
    log_evidence = scipy.special.logsumexp(log_posterior) + np.log(volume)
    quotient = np.exp(np.asarray(found.log_evidence, float).sum(1) - log_evidence)
    scores.append([(quotient.mean() - 1) / quotient.std(ddof=1)])
    worst = np.abs(np.concatenate(scores)).max() * num_runs**0.5
    assert worst < 4.5 if ratio else worst > 4.5
    assert np.nanmean(found.acceptance) > 0.1


# Long jobs: progress, and going on after an interruption.  All their pieces have 50 steps, so that
# few programs are compiled.


def by_pmmh(**settings):
    few = {"num_draws": 50, "num_warmup": 100, "num_chains": 3, "blocks": 2, "paths": True}
    return jaxpf.pmmh(build, log_prior, KEY, FRAMES, START, **few | settings)


def by_smc2(**settings):
    few = {"num_draws": 20, "num_particles": 10}
    frames = np.tile(FRAMES, 5)
    return jaxpf.tuning.smc2(build, log_prior, draw_prior, KEY, frames, **few | settings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("job", "total"), [(by_pmmh, 150), pytest.param(by_smc2, 100, marks=pytest.mark.always)]
)
def test_an_interrupted_job_goes_on_and_ends_with_the_same_bits(tmp_path, job, total):
    places = []

    def interrupted(done, of):
        raise KeyboardInterrupt

    def reported(done, of):
        assert of == total
        places.append(done)

    with pytest.raises(KeyboardInterrupt):
        job(folder=tmp_path, progress=interrupted)
    files = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.npz")}
    assert files
    places.clear()
    resumed = job(folder=tmp_path, progress=reported)
    assert places[-1] == total
    assert places == sorted(places)
    for path, time in files.items():
        assert path.stat().st_mtime_ns == time  # read, not computed again
    for one, other in zip(jax.tree.leaves(resumed), jax.tree.leaves(job()), strict=True):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(InputError, match=r"was begun with num_draws = .*, now 61; choose"):
        job(folder=tmp_path, num_draws=61)
