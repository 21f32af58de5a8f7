"""Bins of colours: known by hand, and against exact arithmetic."""

import jax
import jax.numpy as jnp
import numpy as np
from histograms import float_bins

from jaxpf.likelihoods.color import hsv_bins


def test_bins_of_colours_known_by_hand():
    colours = {
        (255, 0, 0): 9, (255, 255, 0): 19, (0, 255, 0): 39, (0, 255, 255): 59,
        (0, 0, 255): 69, (255, 0, 255): 89, (255, 0, 1): 99, (255, 229, 229): 1,
        (255, 230, 230): 109, (51, 0, 0): 102, (52, 0, 0): 9, (0, 0, 0): 100,
        (26, 26, 26): 101, (255, 255, 255): 109, (10, 9, 10): 100, (200, 180, 180): 107,
    }  # fmt: skip
    got = hsv_bins(jnp.array(list(colours), jnp.uint8))
    assert got.tolist() == list(colours.values())


def test_bins_agree_for_every_24_bit_colour():
    level = np.arange(256, dtype=np.uint8)
    binned = jax.jit(hsv_bins)
    for red in range(0, 256, 15):
        frame = np.stack(np.meshgrid([red], level, level, indexing="ij"), -1).astype(np.uint8)
        np.testing.assert_array_equal(np.asarray(binned(frame)), float_bins(frame))
