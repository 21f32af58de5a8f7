"""Patch likelihood: compare a window of pixels with a picture, invariant to brightness.

Source: eskil2014, eq. 6 and 7.  With o the window's pixels, r the reference's and E the mean over
the window, all channels together::

    d = r / E[r] - o / E[o],    log p(y | x) = -||d||^2 / sigma^2

On a window of n entries, independent errors add up to a sum that is far too sharp for particles
(21 x 21 pixels RGB, off by 5%: -331).  So here ``||d||^2`` is divided by n; for the paper's
literal rule divide sigma by the square root of n.  Pixel (i, j), row i and column j, is the square
[j, j + 1) x [i, i + 1); pixels outside the frame are black.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import Likelihood
from jaxpf.contract.numbers import FINITE, check_number, numbers_in
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field
from jaxpf.likelihoods._checks import (
    DARKEST_MEAN,
    check_coordinates,
    check_not_black,
    check_pictures,
    check_window,
    checked_sizes,
)
from jaxpf.likelihoods._windows import window_colours, words_of
from jaxpf.likelihoods.color import check_frame


@pytree_dataclass
class PatchLikelihood(Likelihood):
    """Patch likelihood of P objects; make one with :func:`patch` or :func:`patch_from_pictures`.

    A substate is (u, v, a) or (u, v, a, theta, ...): the window's centre in pixels from the left
    and the top of the frame, its scale, and its rotation in radians, clockwise in the image; the
    window is ``a * w`` by ``a * h``.

    Attributes:
        sigma: scalar, sigma_o of eskil2014.
        references: [P, rows * columns, 3], r / E[r].
        sizes: [P, 2], width and height of the window at scale 1, pixels.
        window: (columns, rows) of the sampling grid.
    """

    sigma: ArrayLike
    references: jax.Array
    sizes: jax.Array
    window: tuple[int, int] = static_field(default=(21, 21))

    #: Reads one pixel per place of the grid, so the value changes in steps.
    state_gradient = False
    #: ``observe`` does not depend on parameters that tuning may change.
    fixed_observation = True

    def observe(self, frame):
        """The frame's colours, one word per pixel: uint32 [H + 2, W + 2] with a black margin.

        Raises:
            InputError: the frame is not uint8 RGB [H, W, 3].
        """
        check_frame(frame)
        return words_of(frame)

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods of N particles.

        Args:
            observation: what :meth:`observe` returned.
            partition: int [N], the object each particle's substate belongs to.
            substates: float [D, N], (u, v, a) or (u, v, a, theta, ...).

        Returns:
            [N] in the dtype of ``substates``: NaN where a substate is not finite; -inf for a
            window under one pixel wide or high.

        Raises:
            InputError: D is below 3.
        """
        wanted = "(u, v, a) or (u, v, a, theta, ...)"
        check_coordinates(substates, "the patch likelihood", wanted, 3)
        dtype = substates.dtype
        u, v, scale = substates[0], substates[1], substates[2]
        theta = substates[3] if substates.shape[0] > 3 else jnp.zeros_like(u)
        width, height = (jnp.asarray(self.sizes, dtype)[partition] * scale[:, None]).T
        seen = window_colours(observation, u, v, width, height, theta, self.window)
        difference = jnp.asarray(self.references, dtype)[partition] - _normalised(seen)
        squares = jnp.sum(difference**2, axis=(1, 2))
        squares = squares / (difference.shape[1] * difference.shape[2])
        log_prob = -squares / jnp.asarray(self.sigma, dtype) ** 2
        log_prob = jnp.where((width >= 1) & (height >= 1), log_prob, -jnp.inf)
        return jnp.where(jnp.all(jnp.isfinite(substates), axis=0), log_prob, jnp.nan)


def patch(
    frame,
    poses,
    sizes,
    *,
    sigma: float = 0.1,
    window: tuple[int, int] = (21, 21),
    names: Sequence[str] | None = None,
) -> PatchLikelihood:
    """Learn the likelihood of P objects from their windows in one frame.

    Args:
        frame: uint8 RGB [H, W, 3].
        poses: [P, 3], x and y of the windows' centres in pixels, and theta in radians, clockwise
            in the image.
        sizes: [P, 2], width and height of the windows, pixels.
        sigma: smaller is sharper; eskil2014 has .1 with its literal rule.
        window: columns and rows of the sampling grid (eskil2014: 21 x 21).
        names: of the windows in messages; by default their numbers.

    Raises:
        InputError: an argument is out of range, or a window is black.
    """
    check_frame(frame)
    wanted = "finite x, y, theta of every object, [>= 1, 3]"
    poses = numbers_in("poses", poses, wanted, FINITE).astype(np.float32)
    check_number("sigma", sigma, above=0)
    check_window(window, "(21, 21)")
    sizes = checked_sizes("sizes", sizes, len(poses), names=names).astype(np.float32)
    u, v, theta = jnp.asarray(poses).T
    width, height = jnp.asarray(sizes).T
    words = words_of(jnp.asarray(frame))
    seen = window_colours(words, u, v, width, height, theta, tuple(window))
    if names is None:
        names = [f"the window of object {i}" for i in range(len(poses))]
    check_not_black(np.asarray(seen), names)
    return _build(_normalised(seen), sizes, sigma, window)


def patch_from_pictures(
    pictures: Sequence[np.ndarray],
    sizes=None,
    *,
    sigma: float = 0.1,
    window: tuple[int, int] = (21, 21),
) -> PatchLikelihood:
    """Learn the likelihood of P objects from one upright picture of each.

    Args:
        pictures: P pictures, uint8 RGB [h, w, 3], of any sizes.
        sizes: [P, 2], width and height of the windows at scale 1, pixels; by default the sizes
            of the pictures.
        sigma, window: as in :func:`patch`.

    Raises:
        InputError: an argument is out of range, or a picture is black.
    """
    check_pictures("pictures", pictures)
    extents = np.array([(len(picture[0]), len(picture)) for picture in pictures], np.float32)
    sizes = checked_sizes("sizes", extents if sizes is None else sizes, len(pictures))
    references = []
    for i, (picture, extent) in enumerate(zip(pictures, extents, strict=True)):
        middle = [(*(extent / 2), 0.0)]
        name = f"pictures[{i}]"
        whole = patch(picture, middle, [extent], sigma=sigma, window=window, names=[name])
        references.append(whole.references[0])
    return _build(jnp.stack(references), sizes, sigma, window)


def _normalised(seen):
    """o / E[o] of windows [N, places, 3]."""
    mean = jnp.mean(seen, axis=(1, 2), keepdims=True)
    return seen / jnp.maximum(mean, DARKEST_MEAN)


def _build(references, sizes, sigma, window) -> PatchLikelihood:
    return PatchLikelihood(
        sigma=as_array(sigma, float),
        references=as_array(references, float),
        sizes=as_array(sizes, float),
        window=tuple(window),
    )
