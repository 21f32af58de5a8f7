"""Normalised forms of the histogram likelihood, as functions of the distance d^2.

A likelihood p(y | x) must integrate to 1 over observations y before its evidence means anything.
smith2004's ``exp(-S d^2)`` does not: for any observation, a smaller sharpness S gives every
particle a larger value, so its evidence always prefers S = 0.  There are three forms, with
s = d^2 in [0, m], m the number of bands.  They differ by a factor that depends only on S and the
object, so weights and estimates are the same in all three.

``"exponential"``
    log p = -S s.  For tracking.  Its evidence compares orderings, numbers of particles and
    motion at one sharpness, never sharpnesses.

``"density"``
    The density of s on [0, m], a truncated exponential distribution: log p = -S s - log Z(S) with
    Z(S) = int_0^m exp(-S s) ds = (1 - exp(-S m)) / S.  It is a density of the *number* s, not of
    the picture: it measures how large s is, not whether s is smaller here than elsewhere, and its
    evidence is largest near S = 1 / mean(s).  Use it to study an object's own distances; as a
    criterion for tracking it prefers too small an S.

``"ratio"``
    log p = -S s - log M(S) with M(S) = int_0^m b(s) exp(-S s) ds, b the density of s at boxes
    anywhere in the frames.  The tilted density b(s) exp(-S s) / M(S) integrates to 1, so this is
    the likelihood ratio of "the object is at x" to "x is anywhere".  If the picture depends on x
    only through s, then p(y | anywhere) times this ratio is a density over *pictures*: what s
    leaves out cancels, and all particles explain the same picture (Sidenbladh & Black, "Learning
    image statistics for Bayesian tracking", ICCV 2001, learn both densities; maccormick1999 divides
    measurement lines by their clutter for the same reason).  Its evidence measures how much better
    a place is than others, so it compares sharpnesses, motion, templates and bands: the form for
    tuning.  M is a mean over boxes of some frames: learn it again if the background changes.  A
    large S distinguishes places a fraction of a pixel apart; M is then only as accurate as the
    spacing of the boxes allows.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import as_array
from jaxpf.lowering.programs import compiled

FORMS = ("exponential", "density", "ratio")

# Boxes measured at once; values kept individually; groups of the remaining values.
_AT_ONCE, _ALONE, _GROUPS = 4096, 1024, 512
# Maximum number of boxes per object and frame: they should lie closer together than the likelihood
# is wide.
_MOST_BOXES = 100_000


def log_normaliser(sharpness: ArrayLike, bands: int) -> jax.Array:
    """log Z(S) of the form "density", in the shape of ``sharpness``."""
    sharpness = jnp.asarray(sharpness)
    return jnp.log(-jnp.expm1(-sharpness * bands)) - jnp.log(sharpness)


def log_tilt(sharpness: ArrayLike, background: jax.Array) -> jax.Array:
    """log M(S) of the form "ratio".

    Args:
        sharpness: [], S.
        background: [..., 2, n], values of s and the logs of their shares.

    Returns:
        [...].
    """
    squared, log_share = background[..., 0, :], background[..., 1, :]
    return jax.nn.logsumexp(log_share - sharpness * squared, axis=-1)


def log_density(form, sharpness, bands, background, partition, squared_distance):
    """Log-likelihood of a form, [N].

    Args:
        form: one of ``FORMS``.
        sharpness: [], S.
        bands: m.
        background: [P, 2, n], see ``learn_background``, for ``"ratio"``, otherwise ignored.
        partition: int [N].
        squared_distance: [N], s.
    """
    value = -sharpness * jnp.asarray(squared_distance)
    if form == "exponential":
        return value
    if form == "density":
        return value - log_normaliser(sharpness, bands)
    return value - log_tilt(sharpness, jnp.asarray(background, value.dtype))[partition]


def learn_background(likelihood: Any, frames: ArrayLike) -> jax.Array:
    """Each object's distribution of d^2 over whole frames, for ``form="ratio"``.

    Boxes have the object's size and lie inside the frame on a grid with a spacing of 1, 2, 3
    or more pixels; the objects' own positions are included.

    Args:
        likelihood: a ``HistogramLikelihood``.
        frames: uint8 RGB [H, W, 3] or [T, H, W, 3].  Use several: an object's smallest d^2
            differs between frames, and if M is learned from a frame in which it is large, any S
            looks too small for the others.

    Returns:
        [P, 2, n]: values of d^2 and the logs of their shares.  The smallest values are kept
        individually; the others, which weigh little, as means of groups.
    """
    frames = np.asarray(frames)
    frames = frames[None] if frames.ndim == 3 else frames
    observations = [likelihood.observe(jnp.asarray(frame)) for frame in frames]
    extent = np.array(frames.shape[2:0:-1], float)
    learned = []
    for partition, size in enumerate(np.asarray(likelihood.sizes, float)):
        if np.any(size > extent):
            raise InputError(
                f"object {partition} is {size[0]:g} x {size[1]:g} pixels, larger than the frame of "
                f"{extent[0]:g} x {extent[1]:g}: no random box of its size fits."
            )
        room = extent - size
        stride = max(1.0, np.ceil(np.sqrt(math.prod(room + 1) / _MOST_BOXES)))
        places = [np.arange(0, length + 1e-6, stride) for length in room]
        centres = np.stack(np.meshgrid(*places), axis=-1).reshape(-1, 2) + size / 2
        substates = np.concatenate([centres, np.ones((len(centres), 1))], axis=1).T
        # In pieces of one width, the last one padded: one program for all objects and frames.
        filled = np.pad(substates, ((0, 0), (0, -len(centres) % _AT_ONCE)), mode="edge")
        filled = filled.astype(likelihood.references.dtype)
        number = np.full(_AT_ONCE, partition, np.int32)
        squared = [
            np.concatenate([
                _squared_distances(likelihood, observation, number, piece)
                for piece in np.split(filled, filled.shape[1] // _AT_ONCE, axis=1)
            ])[: len(centres)]
            for observation in observations
        ]  # fmt: skip
        learned.append(compressed(np.concatenate(squared)))
    # In a small frame the number of boxes may be smaller, and differ between objects: a share of 0.
    longest = max(law.shape[1] for law in learned)
    fill = np.array([[0.0], [-np.inf]]) * np.ones(longest)
    every = [np.append(law, fill[:, law.shape[1] :], axis=1) for law in learned]
    return as_array(np.stack(every), float)


@compiled
def _squared_distances(likelihood, observation, partition, substates):
    return likelihood.squared_distance_all(observation, partition, substates)[0]


def compressed(squared: np.ndarray) -> np.ndarray:
    """[2, n] of many values: the smallest individually, the rest as means of groups."""
    ordered = np.sort(squared.astype(np.float64))
    alone, rest = ordered[:_ALONE], ordered[_ALONE:]
    groups = np.array_split(rest, min(_GROUPS, len(rest))) if len(rest) else []
    values = np.concatenate([alone, [group.mean() for group in groups]])
    counts = np.concatenate([np.ones(len(alone)), [len(group) for group in groups]])
    return np.stack([values, np.log(counts / len(ordered))])
