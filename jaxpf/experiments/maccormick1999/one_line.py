"""Figure 3: the likelihoods of one and of two targets on one measurement line."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.experiments.claims import Claim, Quantity, judged
from jaxpf.media import plotting
from jaxpf.models.likelihoods.contours import (
    Features,
    detection_probabilities,
    line_weights,
    log_ratio,
    poisson_clutter,
)

#: Four features, as in the paper's figure; their places are read off it roughly.
PLACES = (-50.0, -15.0, 20.0, 55.0)
_LENGTH, _SIGMA, _CLUTTER = 161, 7.0, 2.0
#: "Much smaller": on the diagonal at most this share of the peaks beside it.
MUCH_SMALLER = 0.5


def likelihood(boundaries: Any) -> np.ndarray:
    """``p~_c / p_0`` ``[...]`` of the line for boundaries ``[c, ...]``, pixels from its middle."""
    return np.asarray(_likelihood(jnp.asarray(boundaries, jnp.float32)))


def peaks() -> tuple[np.ndarray, np.ndarray]:
    """The two-target likelihood at one feature twice, ``[4]``, and at pairs of them, ``[6]``."""
    first, second = np.triu_indices(len(PLACES), 1)
    places = np.array(PLACES)
    together = likelihood(np.stack([places, places]))
    return together, likelihood(np.stack([places[first], places[second]]))


def claims() -> list[Claim]:
    """What the paper says of figure 3, which has no chance in it."""
    together, apart = peaks()
    share = float(together.max() / apart.min())
    return [
        judged(
            "The likelihood of two targets is much smaller where both lie on one feature than "
            f"where each has its own (at most {MUCH_SMALLER:g} of it)",
            "2, figure 3",
            "figure only",
            [Quantity("", share, lambda level: (share, share), 0.0, MUCH_SMALLER)],
            digits=2,
        )
    ]


def figure() -> Any:
    """One target above, two below, as the paper draws them."""
    grid = np.linspace(-80, 80, 161)
    drawing, axes = plotting.new_figure(1, 2, figsize=(11, 4.6))
    one, two = axes[0]
    one.plot(grid, likelihood(grid[None]), color="black")
    one.plot(PLACES, np.zeros(4), "o", color="gray")
    one.set(xlabel="boundary (pixels along the line)", ylabel="one target, relative to clutter")
    pairs = np.stack(np.meshgrid(grid, grid))
    shown = two.imshow(likelihood(pairs), origin="lower", extent=(-80, 80, -80, 80), cmap="gray_r")
    two.plot([-80, 80], [-80, 80], ":", color="gray", lw=1)
    two.set(xlabel="boundary of A (pixels)", ylabel="boundary of B (pixels)", title="two targets")
    drawing.colorbar(shown, ax=two)
    drawing.suptitle("Figure 3 repeated: four features, on each of which one boundary may lie")
    return drawing


@jax.jit
def _likelihood(boundaries: jax.Array) -> jax.Array:
    count, shape = len(PLACES), boundaries.shape[1:]
    places = jnp.broadcast_to(jnp.array(PLACES).reshape(-1, *[1] * len(shape)), (count, *shape))
    features = Features(places, jnp.ones(places.shape, bool))
    weights = line_weights(
        poisson_clutter(_CLUTTER, count), detection_probabilities(len(boundaries)), _LENGTH
    )
    there = jnp.ones(boundaries.shape, bool)
    return jnp.exp(log_ratio(weights, features, boundaries, there, _SIGMA, _LENGTH / 2))
