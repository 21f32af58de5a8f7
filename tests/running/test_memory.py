"""Memory of runs and gradients over many frames, as the compiler states it; nothing is executed."""

from functools import partial

import jax
import jax.numpy as jnp
import pytest
from jax import lax
from models import partitioned, walks

import jaxpf
from jaxpf.gradients import StopGradient
from jaxpf.tuning import log_evidence

pytestmark = pytest.mark.slow


def size(lowered):
    return int(lowered.compile().memory_analysis().temp_size_in_bytes)


@pytest.mark.parametrize(
    ("make", "count"),
    [
        (partial(partitioned, jaxpf.ordering.sir(1)), 1),
        (jaxpf.Labelled, 10),
    ],
)
def test_memory_does_not_grow_with_the_number_of_frames(make, count):
    tracker = make(**walks(count), num_particles=10_000)

    def track(key, observed):
        def step(state, item):
            state, summary = tracker.step(jax.random.fold_in(key, item[0]), state, item[1])
            return state, summary.log_evidence

        items = (jnp.arange(observed.shape[0]), observed)
        return lax.scan(step, tracker.init(key), items)[1]

    few, many = (
        size(jax.jit(track).lower(jax.random.key(0), jnp.zeros((num_frames, count, 1))))
        for num_frames in (10, 1000)
    )
    # What grows is what the record keeps of a frame (4 bytes), not a copy of the particles.
    assert (many - few) / 990 < 100


def test_windows_bound_the_memory_of_a_gradient():
    tracker = partitioned(jaxpf.ordering.sir(1), num_particles=1000, gradient=StopGradient())
    keys = jax.random.split(jax.random.key(0), 10)

    def evidence(tracker, keys, frames, way):
        return jnp.mean(log_evidence(tracker, keys, frames, checkpoint=way))

    gradient = jax.jit(jax.grad(evidence, allow_int=True), static_argnums=3)

    def needed(num_frames, way):
        return size(gradient.lower(tracker, keys, jnp.zeros((num_frames, 1, 1)), way))

    window_few, window_many = needed(100, 32), needed(1000, 32)
    whole, frame_by_frame = needed(1000, False), needed(1000, True)
    assert window_many < 0.5 * frame_by_frame < 0.5 * whole
    # Windows of k keep T / k sets of particles and k frames: less than 2.5 times as much.
    assert window_many < 2.5 * window_few
