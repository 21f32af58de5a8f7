"""Colour histograms with a fixed number of places for objects that appear later.

Array shapes depend only on the number of places, so objects can come and go without recompilation.
All colour bins are counted, since a new object may have any; ``histogram`` counts only those that
occur in an object.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.numbers import check_whole
from jaxpf.likelihoods._checks import sizes_in
from jaxpf.likelihoods._integral import LANES
from jaxpf.likelihoods.color import NUM_BINS, check_frame, hsv_bins
from jaxpf.likelihoods.histogram import (
    HistogramLikelihood,
    box_histogram,
    histogram_from_patches,
)
from jaxpf.lowering.programs import compiled

#: Largest number of objects at once.
_MOST_OBJECTS = 4096


def open_histogram(
    capacity: int,
    frame_shape: tuple[int, int],
    *,
    typical_size: tuple[float, float] = (32.0, 64.0),
    sharpness: float = 20.0,
    bands: int = 2,
    method: str = "auto",
    num_particles: int | None = None,
) -> HistogramLikelihood:
    """A likelihood with ``capacity`` empty places; fill one with ``with_object``.

    Args:
        capacity: P.
        frame_shape: height and width of the frames.
        typical_size: width and height of a typical object in pixels, which set the spacing of
            samples.
        sharpness, bands: as in ``histogram``.
        method: ``"integral"``, ``"sampled"`` or ``"auto"``, which means sampled except for huge
            particle sets, as all bins are counted.
        num_particles: of all objects together, for ``"auto"``.
    """
    check_whole("capacity", capacity, most=_MOST_OBJECTS)
    check_whole("bands", bands)
    # A picture that contains every bin determines the shapes of the arrays.
    colours = np.stack(np.meshgrid(*[np.arange(0, 256, 15)] * 3), axis=-1).reshape(1, -1, 3)
    picture = np.repeat(colours.astype(np.uint8), bands, axis=0)
    likelihood = histogram_from_patches(
        [picture],
        [typical_size],
        sharpness=sharpness,
        bands=bands,
        method=method,
        num_particles=num_particles,
        frame_shape=frame_shape,
    )
    num_bins = -(-NUM_BINS // LANES) * LANES
    return dataclasses.replace(
        likelihood,
        references=jnp.zeros((capacity, bands, num_bins)),
        sizes=jnp.ones((capacity, 2)),
        bin_lookup=jnp.arange(NUM_BINS, dtype=jnp.int32),
        table_dtype="uint32",
        levels=None,
    )


def with_object(
    likelihood: HistogramLikelihood, place: int, frame: np.ndarray, box: ArrayLike
) -> HistogramLikelihood:
    """The likelihood with an object, learned from a box in a frame, in one place.

    Args:
        likelihood: from ``open_histogram``.
        place: 0 to P - 1.
        frame: uint8 RGB [H, W, 3].
        box: x, y, w, h in pixels; pixels outside the frame are ignored.
    """
    check_frame(frame)
    check_whole("place", place, 0, len(likelihood.references) - 1)
    box, bands = np.asarray(box, float), likelihood.references.shape[1]
    sizes_in(box[None, 2:], ["the box"], bands)
    learned = np.zeros(likelihood.references.shape[1:])
    learned[:, :NUM_BINS] = np.sqrt(box_histogram(np.asarray(_bins(frame)), box, bands, "the box"))
    return _replaced(likelihood, place, learned, box[2:])


_bins = compiled(hsv_bins)


@compiled
def _replaced(likelihood, place, reference, size):
    references, sizes = likelihood.references, likelihood.sizes
    return dataclasses.replace(
        likelihood,
        references=references.at[place].set(reference.astype(references.dtype)),
        sizes=sizes.at[place].set(size.astype(sizes.dtype)),
    )
