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

The expected box is the filter's last estimate if it reports one (``expecting``), otherwise the
target's own size.  Pixel (i, j) is the square [j, j + 1) x [i, i + 1); pixels outside the frame are
black.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import Likelihood, of_partition
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.likelihoods._checks import (
    INTERPOLATIONS,
    check_pictures,
    check_window,
    window_sizes,
)
from jaxpf.likelihoods._windows import window_colours, words_of
from jaxpf.likelihoods.color import check_frame

POOLS = ("mean", "product")
SIZES = ("sides", "scale")
COLOURS = ("colour", "grey")


@pytree_dataclass
class PixelLikelihood(Likelihood):
    """Pixel likelihood of L targets; make one with :func:`pixels`.

    A substate is (u, v, w, h, ...), centre and sides in pixels (``size="sides"``), or
    (u, v, a, ...), where the sides are a times the target's own (``size="scale"``).

    Attributes:
        sigma: standard deviation of a pixel's noise in each channel, on the scale 0 to 255.
        references: [L, M, channels], the targets' pixels A on the grid.
        sizes: [L, 2], width and height at scale 1, pixels.
        expected: [L, 2], the expected boxes for power and size term, pixels.
        min_slope: s, per pixel; None disables the power.
        size_term: b; None disables the size term.
        window: (columns, rows) of the grid.
        pool: ``"mean"`` (eq. 3) or ``"product"``.
        size: ``"sides"`` or ``"scale"``.
        colour: ``"colour"`` or ``"grey"``.
        interpolation: ``"nearest"``, or ``"bilinear"``, which has gradients and blurs noise.
    """

    sigma: Any
    references: Any
    sizes: Any
    expected: Any
    min_slope: Any = None
    size_term: Any = None
    window: tuple[int, int] = static_field(default=(8, 12))
    pool: str = static_field(default="mean")
    size: str = static_field(default="sides")
    colour: str = static_field(default="colour")
    interpolation: str = static_field(default="nearest")

    #: ``observe`` depends on no parameter.
    fixed_observation = True

    @property
    def state_gradient(self) -> bool:
        """Whether ``log_prob`` is differentiable in the substate."""
        return self.interpolation == "bilinear"

    def observe(self, frame):
        """The frame's colours or greys, one word per pixel: uint32 [H + 2, W + 2].

        Raises:
            InputError: the frame is not uint8 RGB [H, W, 3].
        """
        check_frame(frame)
        return _words(frame, self.colour)

    def expecting(self, estimates: jax.Array) -> "PixelLikelihood":
        """The likelihood with expected boxes from estimates ``[L, D]``."""
        sides = self._sides(estimates.T, jnp.arange(estimates.shape[0]))
        expected = jnp.maximum(jnp.stack(sides, axis=-1), 1.0)
        return dataclasses.replace(self, expected=jax.lax.stop_gradient(expected))

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods of N particles.

        Args:
            observation: what :meth:`observe` returned.
            partition: int [N], the target of each particle.
            substates: float [D, N].

        Returns:
            [N] in the dtype of ``substates``: NaN where a box is not finite; -inf for a box
            under one pixel wide or high.

        Raises:
            InputError: D is too small for a box.
        """
        needed = 4 if self.size == "sides" else 3
        if substates.shape[0] < needed:
            raise InputError(
                f"a substate has {substates.shape[0]} values: the pixel likelihood takes "
                f"{'(u, v, w, h, ...)' if needed == 4 else '(u, v, a, ...)'} with "
                f"size={self.size!r}."
            )
        dtype = substates.dtype
        u, v = substates[0], substates[1]
        width, height = self._sides(substates, partition)
        upright = jnp.zeros_like(u)
        seen = window_colours(
            observation, u, v, width, height, upright, self.window, self.interpolation
        )
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
        expected = jnp.asarray(self.expected, dtype)
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
        finite = jnp.all(jnp.isfinite(substates[:needed]), axis=0)
        return jnp.where(finite, log_prob, jnp.nan)

    def _sides(self, substates, partition):
        """Width and height of every box, ``[N]`` each, in pixels."""
        if self.size == "sides":
            return substates[2], substates[3]
        sizes = of_partition(jnp.asarray(self.sizes, substates.dtype), partition)
        return sizes[:, 0] * substates[2], sizes[:, 1] * substates[2]


def pixels(
    pictures: Sequence[Any],
    sizes=None,
    *,
    sigma: float = 20.0,
    window: tuple[int, int] = (8, 12),
    pool: str = "mean",
    size: str = "sides",
    colour: str = "colour",
    interpolation: str = "nearest",
    min_slope: float | None = None,
    size_term: float | None = None,
) -> PixelLikelihood:
    """Learn the likelihood of L targets from one upright picture of each.

    Args:
        pictures: L pictures, uint8 RGB [h, w, 3], of any sizes.
        sizes: [L, 2], width and height of the targets at scale 1, pixels; by default the sizes
            of the pictures.
        sigma: standard deviation of a pixel in each channel, on the scale 0 to 255, from camera
            noise and changes of the target's appearance.
        window: columns and rows of the grid on which the picture and every box are sampled.
        pool: ``"mean"`` (eq. 3) or ``"product"``.
        size: how a substate describes the box, ``"sides"`` or ``"scale"``.
        colour: ``"colour"`` compares three channels, ``"grey"`` their brightness.
        interpolation: ``"nearest"`` or ``"bilinear"``.
        min_slope: s of the power, per pixel; None disables it.
        size_term: b of the size term; None disables it.

    Raises:
        InputError: an argument is out of range.
    """
    check_pictures("pictures", pictures)
    extents = np.array([(len(picture[0]), len(picture)) for picture in pictures], np.float32)
    sizes = window_sizes(extents if sizes is None else sizes, len(pictures), "targets")
    check_number("sigma", sigma, above=0)
    for name, value in (("min_slope", min_slope), ("size_term", size_term)):
        if value is not None:
            check_number(name, value, least=0)
    check_window(window, "(8, 12)")
    check_known("pool=", pool, POOLS)
    check_known("size=", size, SIZES)
    check_known("colour=", colour, COLOURS)
    check_known("interpolation=", interpolation, INTERPOLATIONS)
    channels = 3 if colour == "colour" else 1
    references = []
    for picture, extent in zip(pictures, extents, strict=True):
        u, v, width, height = (jnp.asarray([x]) for x in (*(extent / 2), *extent))
        words = _words(jnp.asarray(picture), colour)
        seen = window_colours(
            words, u, v, width, height, jnp.zeros(1), tuple(window), interpolation
        )
        references.append(seen[0, :, :channels])
    return PixelLikelihood(
        sigma=as_array(sigma, float),
        references=as_array(jnp.stack(references), float),
        sizes=as_array(sizes, float),
        expected=as_array(sizes, float),
        min_slope=None if min_slope is None else as_array(min_slope, float),
        size_term=None if size_term is None else as_array(size_term, float),
        window=(window[0], window[1]),
        pool=pool,
        size=size,
        colour=colour,
        interpolation=interpolation,
    )


def _words(frame, colour):
    if colour == "colour":
        return words_of(frame)
    # ITU-R BT.601, as most video readers use.
    grey = frame.astype(jnp.float32) @ jnp.asarray([0.299, 0.587, 0.114], jnp.float32)
    return jnp.pad(jnp.round(grey).astype(jnp.uint32), 1)
