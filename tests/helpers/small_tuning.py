"""One walker to tune, and a sequence to learn from."""

import jax.numpy as jnp
import numpy as np
from models import partitioned

from jaxpf import ordering
from jaxpf.dynamics import RandomWalk
from jaxpf.likelihoods import Gaussian
from jaxpf.tuning import Settings, TrainingSequence


def tracker(scale=1.0, noise=1.0, **options):
    return partitioned(
        ordering.sir(1),
        dynamics=RandomWalk(scale=jnp.array([scale])),
        likelihood=Gaussian(noise=jnp.full((1, 1, 1), noise)),
        num_particles=50,
        **options,
    )


def made_sequence(seed=0, scale=1.0, noise=1.0, num_frames=8, **options):
    rng = np.random.default_rng(seed)
    places = np.cumsum(scale * rng.standard_normal((num_frames, 1, 1)), axis=0)
    frames = places + noise * rng.standard_normal(places.shape)
    return TrainingSequence(
        tracker(**options), np.float32(frames), truth=np.float32(places), name=f"sequence {seed}"
    )


QUICK = Settings(steps=8, repeats=2, window=2, tolerance=0.0)
SCALE = ["dynamics.scale"]
