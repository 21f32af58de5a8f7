"""What a histogram's distance d^2 says: likelihoods that can be compared, or not.

A likelihood p(y | x) must integrate to 1 over observations y before its evidence means anything.
smith2004's ``exp(-S d^2)`` does not: whatever is observed, a smaller sharpness S gives every
particle a larger value, so its evidence always prefers S = 0.  There are three forms, with
s = d^2 in [0, m], m the number of parts:

``"exponential"``
    log p = -S s.  For tracking: weights and estimates, for which a constant does not matter.
    Its evidence compares orderings, numbers of particles and motion at one sharpness, never
    sharpnesses.

``"density"``
    The density of s on [0, m], an exponential distribution cut off at m::

        f(s) = exp(-S s) / Z(S),   Z(S) = int_0^m exp(-S s) ds = (1 - exp(-S m)) / S

    log p = -S s - log Z(S).  Weights and estimates are those of ``"exponential"``, and the
    evidence has a maximum in S: where s is the same whatever S, at S = 1 / mean(s) nearly.
    It is a density of the *number* s, not of the picture: s is another function of the picture
    for every particle, so evidence of different templates, parts or bins must not be compared,
    and evidence favours places of a small distance, what they show set aside.

``"ratio"``
    f(s) / b(s), b the density of s at random boxes of a frame, where the object is not.  If y
    depends on x through s alone, then p(y | x) = p(y | no object) f(s) / b(s): the densities of s
    cancel what s leaves out, and particles are compared on one and the same picture
    (Sidenbladh & Black, "Learning image statistics for Bayesian tracking", ICCV 2001;
    maccormick1999 divides measurement lines by their clutter for the same reason).  Its evidence
    compares templates, parts and bins as well.  Weights differ from ``"exponential"``: what looks
    like background is punished.  Meaningful as far as the frame's random boxes are what a wrong
    particle sees.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.errors import InputError

FORMS = ("exponential", "density", "ratio")

#: Nodes between which the background's density is linear.
NODES = 33


def log_normaliser(sharpness: Any, parts: int) -> jax.Array:
    """log Z(S) of the module, [] or the shape of ``sharpness``."""
    sharpness = jnp.asarray(sharpness)
    return jnp.log(-jnp.expm1(-sharpness * parts)) - jnp.log(sharpness)


def log_density(form, sharpness, parts, background, partition, squared_distance):
    """Log of a form's value, [N].

    Args:
        form: one of ``FORMS``.
        sharpness: [], S.
        parts: m.
        background: [P, NODES] densities for ``"ratio"``, else ignored.
        partition: int [N].
        squared_distance: [N], s.
    """
    value = -sharpness * squared_distance
    if form == "exponential":
        return value
    value = value - log_normaliser(sharpness, parts)
    if form == "density":
        return value
    background = jnp.asarray(background, value.dtype)
    last = background.shape[-1] - 1
    place = jnp.clip(squared_distance * (last / parts), 0, last)
    node = jnp.clip(jnp.floor(jax.lax.stop_gradient(place)), 0, last - 1).astype(jnp.int32)
    lower, upper = background[partition, node], background[partition, node + 1]
    return value - jnp.log(lower + (place - node) * (upper - lower))


def density_of_samples(squared_distances, parts: int, uniform_share: float) -> np.ndarray:
    """A density on [0, m], linear between ``NODES`` nodes, of samples.

    Args:
        squared_distances: [n], s of random boxes.
        parts: m.
        uniform_share: of the density that is spread evenly, so that it is nowhere 0.

    Returns:
        [NODES], which integrates to 1 by the trapezoidal rule.
    """
    last = NODES - 1
    place = np.clip(np.asarray(squared_distances, np.float64) * (last / parts), 0, last)
    node = np.minimum(place.astype(int), last - 1)
    mass = np.zeros(NODES)
    np.add.at(mass, node, 1 - (place - node))
    np.add.at(mass, node + 1, place - node)
    width = np.full(NODES, parts / last)
    width[[0, -1]] /= 2
    return uniform_share / parts + (1 - uniform_share) * mass / (len(place) * width)


def learn_background(
    likelihood: Any,
    frame: Any,
    *,
    num_boxes: int = 2000,
    seed: int = 0,
    uniform_share: float = 0.02,
) -> jax.Array:
    """Densities of every object's d^2 at random boxes of a frame, for ``form="ratio"``.

    Boxes have the object's size and lie anywhere within the frame, the objects' own places
    included: these are few.

    Args:
        likelihood: a ``HistogramLikelihood``.
        frame: uint8 RGB [H, W, 3].
        num_boxes: how many, per object.
        seed: of the boxes.
        uniform_share: see ``density_of_samples``; it bounds the ratio where no random box was.

    Returns:
        [P, NODES].

    Raises:
        InputError: an argument is out of range, or an object is larger than the frame.
    """
    if num_boxes < 1:
        raise InputError(f"num_boxes is {num_boxes}: it must be at least 1.")
    if not 0 < uniform_share < 1:
        raise InputError(f"uniform_share is {uniform_share}: it must lie between 0 and 1.")
    observation = likelihood.observe(jnp.asarray(frame))
    parts = likelihood.references.shape[1]
    rng = np.random.default_rng(seed)
    extent = np.array(frame.shape[1::-1], float)
    learned = []
    for partition, size in enumerate(np.asarray(likelihood.sizes, float)):
        if np.any(size > extent):
            raise InputError(
                f"object {partition} is {size[0]:g} x {size[1]:g} pixels, larger than the frame of "
                f"{extent[0]:g} x {extent[1]:g}: no random box of its size fits."
            )
        centre = size / 2 + rng.uniform(size=(num_boxes, 2)) * (extent - size)
        substates = np.concatenate([centre, np.ones((num_boxes, 1))], axis=1).T
        squared, _ = likelihood.squared_distance_all(
            observation,
            jnp.full(num_boxes, partition, jnp.int32),
            jnp.asarray(substates, likelihood.references.dtype),
        )
        learned.append(density_of_samples(squared, parts, uniform_share))
    return jnp.asarray(np.stack(learned), float)
