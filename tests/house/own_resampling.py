"""A resampling scheme of one's own: systematic, with the particles shuffled before."""

import jax
import jax.numpy as jnp

import jaxpf


@jaxpf.pytree_dataclass
class Shuffled:
    def __call__(self, key, log_weights, count):
        order_key, place_key = jax.random.split(key)
        order = jax.random.permutation(order_key, log_weights.shape[0])
        total = jnp.cumsum(jnp.exp(log_weights[order]))
        wanted = (jnp.arange(count) + jax.random.uniform(place_key)) / count * total[-1]
        return order[jnp.searchsorted(total, wanted, side="right")]


def shuffled(scene):
    places = range(scene.num_objects)
    orders = jaxpf.ordering.dps(orders=[places, places[::-1]])
    return jaxpf.boxes.tracker(
        scene.frames[0],
        scene.boxes[0],
        ordering=orders,
        appearance="colour",
        num_particles=60,
        resampling=Shuffled(),
    )
