"""What a histogram's distance d^2 says: likelihoods that can be compared, or not.

A likelihood p(y | x) must integrate to 1 over observations y before its evidence means anything.
smith2004's ``exp(-S d^2)`` does not: whatever is observed, a smaller sharpness S gives every
particle a larger value, so its evidence always prefers S = 0.  There are three forms, with
s = d^2 in [0, m], m the number of parts.  They differ in a constant that depends on S and on the
object, so particles' weights and estimates are the same in all three: a value of S that was found
with one is good for another.

``"exponential"``
    log p = -S s.  For tracking.  Its evidence compares orderings, numbers of particles and
    motion at one sharpness, never sharpnesses.

``"density"``
    The density of s on [0, m], an exponential distribution cut off at m::

        f(s) = exp(-S s) / Z(S),   Z(S) = int_0^m exp(-S s) ds = (1 - exp(-S m)) / S

    log p = -S s - log Z(S).  Where s is the same whatever S, its evidence is largest at
    S = 1 / mean(s) nearly.  It is a density of the *number* s, not of the picture: it asks how
    large s is, and not whether s is smaller here than elsewhere.  Meaningful where the object's
    own distances are the question; as a criterion for tracking it prefers too small an S
    (measured on the scene "distracter", N = 100: 2 to 4, where boxes overlap the truth by 62 to
    70 %, against 76 to 81 % at 8 to 14).

``"ratio"``
    Let b be the density of s at boxes that lie anywhere in a frame.  Tilted by exp(-S s)::

        f(s) = b(s) exp(-S s) / M(S),   M(S) = int_0^m b(s) exp(-S s) ds

    integrates to 1 over s in [0, m], and the likelihood ratio of "the object is at x" to "x is
    anywhere" is f(s) / b(s) = exp(-S s) / M(S).  If the picture depends on x through s alone, then
    p(y | x) = p(y | anywhere) f(s) / b(s) is a density over *pictures*: what s leaves out cancels,
    and all particles explain one and the same picture (Sidenbladh & Black, "Learning image
    statistics for Bayesian tracking", ICCV 2001, learn both densities; maccormick1999 divides
    measurement lines by their clutter for the same reason).  log p = -S s - log M(S), with M the
    mean over boxes of a frame.  Its evidence asks how much better a place is than the others, so
    it compares sharpnesses, motion, templates and parts: the form for tuning.  Meaningful as far
    as that frame's boxes are what a wrong particle sees; learn it anew where the background
    changes.  Beyond S = n / mean(s) or so, n boxes are too few to tell M.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.errors import InputError

FORMS = ("exponential", "density", "ratio")


def log_normaliser(sharpness: Any, parts: int) -> jax.Array:
    """log Z(S) of the form "density", [] or the shape of ``sharpness``."""
    sharpness = jnp.asarray(sharpness)
    return jnp.log(-jnp.expm1(-sharpness * parts)) - jnp.log(sharpness)


def log_tilt(sharpness: Any, background: Any) -> jax.Array:
    """log M(S) of the form "ratio".

    Args:
        sharpness: [], S.
        background: [..., n], s of n boxes.

    Returns:
        [...].
    """
    background = jnp.asarray(background)
    total = jax.nn.logsumexp(-sharpness * background, axis=-1)
    return total - np.log(background.shape[-1])


def log_density(form, sharpness, parts, background, partition, squared_distance):
    """Log of a form's value, [N].

    Args:
        form: one of ``FORMS``.
        sharpness: [], S.
        parts: m.
        background: [P, n], s of boxes anywhere, for ``"ratio"``, else ignored.
        partition: int [N].
        squared_distance: [N], s.
    """
    value = -sharpness * squared_distance
    if form == "exponential":
        return value
    if form == "density":
        return value - log_normaliser(sharpness, parts)
    return value - log_tilt(sharpness, jnp.asarray(background, value.dtype))[partition]


def learn_background(
    likelihood: Any, frame: Any, *, num_boxes: int = 2000, seed: int = 0
) -> jax.Array:
    """Every object's d^2 at random boxes of a frame, for ``form="ratio"``.

    Boxes have the object's size and lie anywhere within the frame, the objects' own places not
    excluded.  They are one to a cell of a grid, at random within it: that covers the frame more
    evenly than chance would.

    Args:
        likelihood: a ``HistogramLikelihood``.
        frame: uint8 RGB [H, W, 3].
        num_boxes: about how many, per object.
        seed: of the boxes.

    Returns:
        [P, n].

    Raises:
        InputError: an argument is out of range, or an object is larger than the frame.
    """
    if num_boxes < 1:
        raise InputError(f"num_boxes is {num_boxes}: it must be at least 1.")
    observation = likelihood.observe(jnp.asarray(frame))
    rng = np.random.default_rng(seed)
    extent = np.array(frame.shape[1::-1], float)
    columns = max(1, round(float(np.sqrt(num_boxes * extent[0] / extent[1]))))
    cells = np.array([columns, max(1, round(num_boxes / columns))])
    corners = np.stack(np.meshgrid(*map(np.arange, cells)), axis=-1).reshape(-1, 2)
    learned = []
    for partition, size in enumerate(np.asarray(likelihood.sizes, float)):
        if np.any(size > extent):
            raise InputError(
                f"object {partition} is {size[0]:g} x {size[1]:g} pixels, larger than the frame of "
                f"{extent[0]:g} x {extent[1]:g}: no random box of its size fits."
            )
        share = (corners + rng.uniform(size=corners.shape)) / cells
        centres = size / 2 + share * (extent - size)
        substates = np.concatenate([centres, np.ones((len(centres), 1))], axis=1).T
        squared, _ = likelihood.squared_distance_all(
            observation,
            jnp.full(len(centres), partition, jnp.int32),
            jnp.asarray(substates, likelihood.references.dtype),
        )
        learned.append(squared)
    return jnp.stack(learned)
