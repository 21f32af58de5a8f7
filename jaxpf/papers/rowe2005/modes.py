"""Section 2: Condensation on two equal modes, such as a target and something that looks like it.

Of N particles on two modes that explain every frame equally well, one mode dies out by chance in
the end, as by genetic drift.  A run then looks stable, while runs differ by the mode that is left.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.stats import norm

import jaxpf
from jaxpf.lowering.programs import compiled

#: N and T are those of the paper's synthetic test.
PARTICLES, FRAMES = 100, 300
#: Runs of which the expectations are compared.
RUNS = 20
#: Modes at -1 and 1: standard deviation of each, and of the motion per frame.
_WIDTH, _MOTION = 0.1, 0.05


def stability(seed: int) -> float:
    """Deviation of the expectations between runs over that within a run, root mean squares."""
    keys = jax.random.split(jax.random.key(seed), RUNS)
    return ratio(np.asarray(_expectations(keys)))


def ratio(expectations: np.ndarray) -> float:
    """Deviation over runs, at each frame, over deviation over frames, in each run; ``[R, T]``."""
    between = expectations.var(axis=0, ddof=1).mean()
    within = expectations.var(axis=1, ddof=1).mean()
    return float(np.sqrt(between / within))


@compiled
def _expectations(keys: jax.Array) -> jax.Array:
    """``[R, T]``: the mean of the particles of each run in each frame."""
    condensation = jaxpf.state_space(
        initial=_either,
        transition=lambda key, x, parameters: x + _MOTION * jax.random.normal(key),
        log_likelihood=lambda y, x, parameters: jnp.logaddexp(
            norm.logpdf(x, -1, _WIDTH), norm.logpdf(x, 1, _WIDTH)
        ),
        num_particles=PARTICLES,
        resampling="multinomial",
    )
    frames = jnp.zeros(FRAMES)
    _, summaries = jax.vmap(lambda key: jaxpf.run(condensation, key, frames))(keys)
    return summaries.estimate[..., 0, 0]


def _either(key: jax.Array, parameters: object) -> jax.Array:
    """A state near one mode or the other, with equal chances."""
    side, near = jax.random.split(key)
    return jnp.where(jax.random.bernoulli(side), 1.0, -1.0) + _WIDTH * jax.random.normal(near)
