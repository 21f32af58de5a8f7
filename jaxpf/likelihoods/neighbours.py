"""Strain between an object and its neighbours: how far they have moved apart since the start.

Points and parts lie on one body, so an object that leaves its neighbours is probably lost.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxpf.contract.pytree import as_array, pytree_dataclass

#: Number of neighbours, and strain that counts as none.
_NUMBER, _STIFF = 3, 0.05


@pytree_dataclass
class Neighbours:
    """The nearest others of P objects; make it with :func:`nearest_others`.

    Attributes:
        places: [P, 2], the objects at the start, pixels.
        nearest: int [P, K], the nearest other objects at the start.
        lengths: [P, K], their distances at the start, pixels.
    """

    places: Any
    nearest: Any
    lengths: Any

    def log_strain(self, partition, points):
        """log(s + .05) [P], with s the median strain between each object and its neighbours.

        The strain of two objects is the difference of their displacements since the start, over
        their distance at the start.

        Args:
            partition: int [P], all objects in any order.
            points: [P, 2], where they are, pixels.
        """
        moved = jnp.zeros_like(points).at[partition].set(points)
        moved -= jnp.asarray(self.places, points.dtype)
        apart = moved[:, None] - moved[jnp.asarray(self.nearest)]
        strain = jnp.sqrt(jnp.sum(apart**2, axis=-1)) / jnp.asarray(self.lengths, points.dtype)
        ordered, count = jnp.sort(strain, axis=1), strain.shape[1]  # jnp.median is slower
        median = (ordered[:, (count - 1) // 2] + ordered[:, count // 2])[partition] / 2
        return jnp.log(median + _STIFF)


def nearest_others(places, least) -> Neighbours | None:
    """The nearest others of objects at ``places`` [P, 2]; None for a single object.

    Args:
        places: x and y in pixels.
        least: shorter distances count as this many pixels, [] or [P, 1].
    """
    if len(places) == 1:
        return None
    apart = np.linalg.norm(places[:, None] - places, axis=-1)
    np.fill_diagonal(apart, np.inf)
    nearest = np.argsort(apart, axis=1)[:, : min(_NUMBER, len(places) - 1)]
    lengths = np.maximum(np.take_along_axis(apart, nearest, axis=1), least)
    return Neighbours(
        as_array(places, float), jnp.asarray(nearest, jnp.int32), as_array(lengths, float)
    )
