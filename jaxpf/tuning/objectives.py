"""Tuning objectives: differentiable functions of a whole tracker.

Every objective runs a tracker R times over a sequence and returns one number per run, ``[R]``,
which shows the spread over runs.  Differentiate it in the tracker by ``jax.grad(...,
allow_int=True)``; the tracker's field ``gradient`` determines what the gradient means.
``tracker`` and ``frames`` are as for ``jaxpf.run``; ``keys``, ``[R]``, are one per run, and the
same keys give the same random numbers.  NaN marks missing labels in ``truth``, which are ignored.
All take the options in ``Options``.
"""

import math
from collections.abc import Callable
from typing import Any, TypedDict, Unpack

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.special import ndtr
from jax.scipy.stats import norm
from jax.typing import ArrayLike

from jaxpf.contract import calls, logs
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole, with_nan
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.state import Summary
from jaxpf.contract.types import TrackerLike
from jaxpf.filters.partitioned.selection import ANCESTORS
from jaxpf.measures import metrics
from jaxpf.measures.outlines import iou as iou_of_outlines
from jaxpf.running import runs
from jaxpf.running.frames import num_frames
from jaxpf.shapes.rectangles import boxes_from_substates, is_proper


class Options(TypedDict, total=False):
    """Options of every objective.

    Attributes:
        checkpoint: what reverse-mode differentiation stores; it changes memory and time, not the
            result.  False stores everything that a frame computes.  True, the default, stores only
            the particles between frames and their ancestors, and recomputes each frame in the
            backward pass, which costs about one more forward pass.  A number k stores only the
            particles of every k-th frame and costs two more; with k near sqrt(T), memory grows with
            the square root of the number of frames.
        observed: as for ``jaxpf.run``.
        inputs: as for ``jaxpf.run``.
    """

    checkpoint: bool | int
    observed: Any
    inputs: Any


def log_evidence(
    tracker: TrackerLike, keys: jax.Array, frames: Any, **options: Unpack[Options]
) -> jax.Array:
    """Log of each run's estimate of ``p(y_1:T)``; -inf if a frame was impossible for all particles.

    Its ``exp`` is unbiased for the evidence if the tracker's estimate is.  The log itself is too
    low by about half its variance.

    The evidence compares models of the *observations*, so the likelihood must be a density of them.
    ``exp(-lambda d^2)`` of a distance d (smith2004) is not: every factor is at most one and lambda
    = 0 makes it one, so its evidence prefers lambda = 0 for any frames.  Tune such a sharpness by a
    supervised loss, or normalise the likelihood.
    """
    increments = _record(keep_log_evidence, tracker, keys, frames, **options)
    return logs.sum_evenly(increments, axis=0)


def position_error(
    tracker: TrackerLike, keys: jax.Array, frames: Any, truth: ArrayLike, **options: Unpack[Options]
) -> jax.Array:
    """Mean distance of the estimate from labelled positions, in the substates' units (pixels).

    Substates begin with the coordinates (u, v), and so does ``truth``, ``[T, P, >= 2]``.
    """
    estimate = _record(_keep_estimate, tracker, keys, frames, **options)
    truth, labelled = _places(truth, estimate)
    offset = jnp.where(labelled[:, None, :, None], estimate[..., :2] - truth[:, None], 0.0)
    square = jnp.sum(offset**2, axis=-1)
    distance = jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)
    return jnp.sum(distance, axis=(0, 2)) / jnp.sum(labelled)


def crps_loss(
    tracker: TrackerLike, keys: jax.Array, frames: Any, truth: ArrayLike, **options: Unpack[Options]
) -> jax.Array:
    """Mean continuous ranked probability score of labelled positions, in pixels.

    u and v are scored separately, as if the particles were normal with their mean and spread
    (Gneiting and Raftery 2007, eq. 21).  The score is small if the estimate is near and the spread
    matches the estimation error; without spread it is the distance.  ``truth`` as for
    ``position_error``.
    """
    estimate, spread = _record(
        lambda state, summary: (summary.estimate, summary.spread),
        tracker,
        keys,
        frames,
        **options,
    )
    truth, labelled = _places(truth, estimate)
    counts = labelled[:, None, :, None]
    offset = jnp.where(counts, estimate[..., :2] - truth[:, None], 0.0)
    wide = counts & (spread[..., :2] > 0)
    spread = jnp.where(wide, spread[..., :2], 1.0)
    z = offset / spread
    narrow = spread * (z * (2 * ndtr(z) - 1) + 2 * norm.pdf(z) - 1 / math.sqrt(math.pi))
    scores = jnp.where(wide, narrow, jnp.abs(offset))
    return jnp.sum(scores, axis=(0, 2, 3)) / (2 * jnp.sum(labelled))


def iou_loss(
    tracker: TrackerLike,
    keys: jax.Array,
    frames: Any,
    truth_boxes: ArrayLike,
    sizes: ArrayLike,
    **options: Unpack[Options],
) -> jax.Array:
    """Mean of 1 - intersection over union of the estimated and the labelled boxes, 0 to 1.

    Where boxes do not overlap, the loss is 1 and its gradient zero: start from parameters that
    track, or add ``position_error``.  Substates begin with (u, v, a), see ``jaxpf.shapes``.

    ``truth_boxes`` ``[T, P, 4]`` are x, y, w, h in pixels; a box of zero width or height is
    ignored.  ``sizes`` ``[P, 2]`` are width and height at scale 1, in pixels.
    """
    estimate = _record(_keep_estimate, tracker, keys, frames, **options)
    truth = _truth(truth_boxes, estimate, least=4)
    labelled = is_proper(truth)
    # Dummy boxes replace missing ones, since 0/0 would put NaN into the gradient.
    truth = jnp.where(labelled[..., None], truth, jnp.ones_like(truth))
    return _loss(metrics.iou(boxes_from_substates(estimate, sizes), truth[:, None]), labelled)


def outline_loss(
    tracker: TrackerLike,
    keys: jax.Array,
    frames: Any,
    truth: ArrayLike,
    outlines: Callable[[jax.Array], jax.Array],
    **options: Unpack[Options],
) -> jax.Array:
    """``iou_loss`` for convex outlines at any angle.

    ``truth`` ``[T, P, V, 2]`` are corners in order, pixels; ``outlines`` is a function of estimates
    ``[..., P, D]`` -> corners ``[..., P, V, 2]``.
    """
    estimate = _record(_keep_estimate, tracker, keys, frames, **options)
    truth = _truth(truth, estimate, num_axes=4)
    labelled = jnp.all(jnp.isfinite(truth), axis=(-2, -1))
    found = outlines(estimate)
    # Dummy outlines replace missing ones and keep NaN out of the gradient.
    truth = jnp.where(labelled[..., None, None], truth, lax.stop_gradient(found[:, 0]))
    return _loss(iou_of_outlines(found, truth[:, None]), labelled)


def _loss(iou: jax.Array, labelled: jax.Array) -> jax.Array:
    """``[R]``, mean of 1 - IoU ``[T, R, P]`` over the labels marked in ``[T, P]``."""
    return jnp.sum(jnp.where(labelled[:, None], 1 - iou, 0.0), axis=(0, 2)) / jnp.sum(labelled)


def keep_log_evidence(state: object, summary: Summary) -> jax.Array:
    """``record`` function for the log evidence."""
    return summary.log_evidence


def _keep_estimate(state: object, summary: Summary) -> jax.Array:
    return summary.estimate


def _record(
    record: Callable[[Any, Any], Any],
    tracker: TrackerLike,
    keys: jax.Array,
    frames: Any,
    checkpoint: bool | int = True,
    observed: Any = None,
    inputs: Any = None,
) -> Any:
    """``record(state, summary)`` for every frame and run, leading axes ``[T, R]``.

    All runs advance together, so each frame is observed once for all of them.
    """
    tracker, frames = runs.ready(tracker, frames, observed, inputs)
    length = num_frames(frames)
    keys = runs.as_key(keys)
    if checkpoint is not False:
        check_whole("checkpoint", int(checkpoint))
    frame_step = runs.frame_step(
        calls.observed_apart(tracker)[0], runs.together(tracker, keys), record
    )
    states = jax.vmap(lambda key: runs.init(tracker, key))(keys)
    items = (jnp.arange(length), frames)
    if checkpoint is False:
        return lax.scan(frame_step, states, items)[1]
    # A loop body is compiled separately: common-subexpression elimination cannot merge it.
    keep = jax.checkpoint_policies.save_only_these_names(ANCESTORS)
    frame_step = jax.checkpoint(frame_step, prevent_cse=False, policy=keep)
    window = min(int(checkpoint), length)
    if window == 1:
        return lax.scan(frame_step, states, items)[1]

    @jax.checkpoint
    def window_step(states, items):
        return lax.scan(frame_step, states, items)

    whole = length // window * window
    head = jax.tree.map(
        lambda x: jnp.asarray(x)[:whole].reshape(-1, window, *jnp.shape(x)[1:]), items
    )
    states, recorded = lax.scan(window_step, states, head)
    recorded = jax.tree.map(lambda x: x.reshape(whole, *x.shape[2:]), recorded)
    if whole == length:
        return recorded
    rest = jax.tree.map(lambda x: jnp.asarray(x)[whole:], items)
    _, last = window_step(states, rest)
    return jax.tree.map(lambda x, y: jnp.concatenate([x, y]), recorded, last)


def _truth(truth: ArrayLike, estimate: jax.Array, num_axes: int = 3, least: int = 2) -> jax.Array:
    """Labels as floats ``[T, P, ..., >= least]``; other shapes would broadcast in silence.

    ``estimate`` is ``[T, R, P, D]``.
    """
    truth = jnp.asarray(with_nan(truth))
    begins, axes = (len(estimate), estimate.shape[2]), truth.shape
    if len(axes) != num_axes or axes[:2] != begins or axes[-1] < least:
        form = ", ".join(map(str, [*begins, *["V"] * (num_axes - 3), f">= {least}"]))
        raise InputError(
            f"truth has shape {list(axes)}; it must have [{form}], for every frame and object, NaN "
            "where not labelled."
        )
    if is_concrete(truth):
        labelled = np.isfinite(np.asarray(truth)).reshape(*begins, -1).all(axis=-1)
        if not labelled.any():
            raise InputError("truth labels no object in any frame; label at least one.")
    return truth


def _places(truth: ArrayLike, estimate: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Labelled positions ``[T, P, 2]``, 0 where missing, and a mask of the labels."""
    truth = _truth(truth, estimate)[..., :2]
    labelled = jnp.all(jnp.isfinite(truth), axis=-1)
    return jnp.where(labelled[..., None], truth, 0.0), labelled
