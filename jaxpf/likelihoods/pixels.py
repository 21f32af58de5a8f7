"""Pixel likelihood: the average density of a box's pixels (rowe2005, eq. 3).

Each of the M pixels of the box, sampled on a grid, is compared with the target's picture under
Gaussian camera noise, and the M densities are *averaged*::

    p(y | x) = (1/M) sum_m N(I_m(x); A_m, sigma^2)

An occluded pixel only fails to contribute, so a half-occluded target keeps half its likelihood.
The *product*, which independent noise implies and which the paper argues against, falls by a factor
of ``exp(-d^2 / 2 sigma^2)`` per occluded pixel.  The mean is not a density of the whole frame: it
is that of one pixel of the box, drawn at random.

The paper makes two corrections; both are off by default:

*Power.*  A box that is off by dx and dy covers the share A = (1 - |dx|/w) (1 - |dy|/h) of the
target (eq. 8), so large targets hardly notice a shift.  With the power ``k = max(1, s max(w, h))``
the slope of A^k at zero is at least s per pixel.  All particles of a target and frame share one k,
from the target's expected box: with one power per particle the result would depend on the units of
intensity.
*Size term.*  Small boxes inside the target match as well as the whole target and overlap it
better, so boxes shrink and collapse.  The factor (w h / expected w h)^b favours larger ones.

The expected box is the filter's last estimate (``look_near``); before, it is the size of the
target's picture.  Pixel (i, j) is the square [j, j + 1) x [i, i + 1); pixels outside the frame are
black.
"""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import Likelihood
from jaxpf.contract.calls import of_partition
from jaxpf.contract.errors import check_known
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.likelihoods._checks import check_window
from jaxpf.likelihoods._sampled import Turned, window_colours, words_of
from jaxpf.likelihoods.color import check_frame

POOLS = ("mean", "product")
COLOURS = ("colour", "grey")


@pytree_dataclass
class PixelLikelihood(Likelihood):
    """Pixel likelihood of L targets; make one with :func:`pixels`.

    A substate is (u, v, w, h, ...), centre and sides of a box in pixels.

    Attributes:
        sigma: standard deviation of a pixel's noise in each channel, on the scale 0 to 255.
        references: [L, M, channels], the targets' pixels A on the grid.
        expected: [L, 2], the expected boxes for power and size term, pixels.
        min_slope: s, per pixel; None disables the power.
        size_term: b; None disables the size term.
        window: (columns, rows) of the grid.
        pool: ``"mean"`` (eq. 3) or ``"product"``.
        colour: ``"colour"`` or ``"grey"``.
    """

    sigma: ArrayLike
    references: jax.Array
    expected: jax.Array
    min_slope: ArrayLike | None = None
    size_term: ArrayLike | None = None
    window: tuple[int, int] = static_field(default=(8, 12))
    pool: str = static_field(default="mean")
    colour: str = static_field(default="colour")

    #: ``log_prob`` is constant between changes of the pixels that the grid meets.
    state_gradient = False
    #: ``observe`` depends on no parameter.
    fixed_observation = True

    def observe(self, frame):
        """The frame's colours or greys, uint32 [H + 2, W + 2], and the expected boxes [L, 2]."""
        check_frame(frame)
        return _words(frame, self.colour), jnp.asarray(self.expected)

    @property
    def look_near(self):
        """Function of (observation, estimates [L, D]): the observation with boxes expected there.

        Raises:
            AttributeError: neither power nor size term is used, so nothing depends on estimates.
        """
        if self.min_slope is None and self.size_term is None:
            raise AttributeError("without power and size term, no boxes are expected")
        return lambda observation, near: (observation[0], jnp.maximum(near[:, 2:4], 1.0))

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods of N particles.

        Args:
            observation: what :meth:`observe` returned.
            partition: int [N], the target of each particle.
            substates: float [D, N].

        Returns:
            [N] in the dtype of ``substates``: NaN where a box is not finite; -inf for a box
            under one pixel wide or high.
        """
        dtype = substates.dtype
        width, height = substates[2], substates[3]
        words, expected = observation
        seen = _colours_in(words, substates, self.window)
        references = of_partition(jnp.asarray(self.references, dtype), partition)
        sigma = jnp.asarray(self.sigma, dtype)
        difference = (seen[..., : references.shape[-1]] - references) / sigma
        log_pixel = -0.5 * jnp.sum(difference**2, axis=-1)
        # Log-densities relative to their peak, so that their power has no units of intensity.
        num_places, num_channels = references.shape[-2:]
        if self.pool == "mean":
            relative = jax.nn.logsumexp(log_pixel, axis=1) - math.log(num_places)
        else:
            relative = jnp.sum(log_pixel, axis=1)
        peak = -num_channels * (jnp.log(sigma) + 0.5 * math.log(2 * math.pi))
        log_prob = relative + peak * (1 if self.pool == "mean" else num_places)
        expected = expected.astype(dtype)
        if self.min_slope is not None:
            slope = jnp.asarray(self.min_slope, dtype)
            power = jnp.maximum(1.0, slope * jnp.max(expected, axis=-1))
            log_prob = log_prob + (of_partition(power, partition) - 1) * relative
        valid = (width >= 1) & (height >= 1)
        if self.size_term is not None:
            area = jnp.where(valid, width * height, 1.0)
            usual = of_partition(jnp.prod(expected, axis=-1), partition)
            log_prob = log_prob + jnp.asarray(self.size_term, dtype) * jnp.log(area / usual)
        log_prob = jnp.where(valid, log_prob, -jnp.inf)
        finite = jnp.all(jnp.isfinite(substates[:4]), axis=0)
        return jnp.where(finite, log_prob, jnp.nan)


def pixels(
    pictures: Sequence[np.ndarray],
    *,
    sigma: float = 20.0,
    window: tuple[int, int] = (8, 12),
    pool: str = "mean",
    colour: str = "colour",
    min_slope: float | None = None,
    size_term: float | None = None,
) -> PixelLikelihood:
    """Learn the likelihood of L targets from one upright picture of each.

    Args:
        pictures: L pictures, uint8 RGB [h, w, 3], of any sizes.
        sigma: standard deviation of a pixel in each channel, on the scale 0 to 255, from camera
            noise and changes of the target's appearance.
        window: columns and rows of the grid on which the picture and every box are sampled.
        pool: ``"mean"`` (eq. 3) or ``"product"``.
        colour: ``"colour"`` compares three channels, ``"grey"`` their brightness.
        min_slope: s of the power, per pixel; None disables it.
        size_term: b of the size term; None disables it.
    """
    extents = np.array([(len(picture[0]), len(picture)) for picture in pictures], np.float32)
    check_number("sigma", sigma, above=0)
    for name, value in (("min_slope", min_slope), ("size_term", size_term)):
        if value is not None:
            check_number(name, value, least=0)
    check_window("window", window)
    check_known("pool=", pool, POOLS)
    check_known("colour=", colour, COLOURS)
    channels = 3 if colour == "colour" else 1
    references = []
    for picture, extent in zip(pictures, extents, strict=True):
        words = _words(jnp.asarray(picture), colour)
        whole = jnp.asarray([*(extent / 2), *extent])[:, None]
        seen = _colours_in(words, whole, tuple(window))
        references.append(seen[0, :, :channels])
    return PixelLikelihood(
        sigma=as_array(sigma, float),
        references=as_array(jnp.stack(references), float),
        expected=as_array(extents, float),
        min_slope=None if min_slope is None else as_array(min_slope, float),
        size_term=None if size_term is None else as_array(size_term, float),
        window=(window[0], window[1]),
        pool=pool,
        colour=colour,
    )


def _colours_in(words, substates, window):
    """Colours at the grid places of boxes (u, v, w, h, ...), [N, rows * columns, 3]."""
    u, v, width, height = substates[:4]
    return window_colours(words, Turned(u, v, width, height, jnp.zeros_like(u)), window)


def _words(frame, colour):
    if colour == "colour":
        return words_of(frame)
    # ITU-R BT.601, as most video readers use.
    grey = frame.astype(jnp.float32) @ jnp.asarray([0.299, 0.587, 0.114], jnp.float32)
    return jnp.pad(jnp.round(grey).astype(jnp.uint32), 1)
