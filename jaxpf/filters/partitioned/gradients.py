"""Gradients through resampling: what ``jax.grad`` of a particle filter means.

A resampling draws integers, which have no derivative.  ``Partitioned(gradient=...)`` says
what stands in for it; all four compose with every scheme, ordering and component, and three
of them with every swap.  x is a particle, w its weight, g a likelihood, n a component's size.

``none``
    Weights are differentiated, ancestors are not: the derivative of the weights is forgotten
    at every resampling.  Cheap, low variance, biased; the bias does not vanish with N.
``stop_gradient``
    After a resampling every weight is divided by its own stopped value: ancestor k gets
    ``w_k / (n stop(rho_k))``, so that the draw's score enters (Scibior & Wood 2021).  The
    forward pass is the same bit for bit, and the expected gradient of the *evidence* is exact
    wherever the evidence is unbiased.  The ratios telescope: a weight's derivative is that of
    ``log g`` summed along the particle's own past, which Fisher's identity asks for, too.
    So the kernel keeps that sum, one row per partition beside the lineage, and an exchanged
    part brings its own past's derivative along; this contains the ratios
    ``log g_k - log(n_g a_g)`` of the draws within groups (combinatorial resampling).  The
    variance grows with the number of frames: prefer short sequences and many runs.
``soft``
    Ancestors are drawn from ``share * rho + (1 - share) / n`` and weighted by the ratio, which
    is differentiable (Karkus, Hsu & Lee 2018).  The filter stays properly weighted; the
    derivative is that of the normalised weights, times the total before.  Some particles are
    wasted, and the bias shrinks with the share.  Weights are then never equal, so that the
    exchanges of ``sps`` are left out: it runs as with ``swap="none"``.
``transport``
    No draw: each particle becomes a mixture of all, by entropy-regularised optimal transport
    (Corenflos et al. 2021); see ``jaxpf.filters.partitioned.transport``.  Differentiable,
    biased, O(N^2), and nobody descends from one particle: refused with any swap.

The *motion* of the particles is differentiated along their paths (``motion_gradient=
"pathwise"``), which needs a likelihood that is differentiable in the state.  One that looks
at whole pixels has a zero derivative almost everywhere, and noise scales then get a gradient
of zero that looks like a result.  ``motion_gradient="score"`` stops the drawn substates and
gives the weights the derivative of ``dynamics.log_density`` at them instead; together with
``stop_gradient`` it is exact in expectation for any likelihood.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.errors import InputError
from jaxpf.pytree import is_concrete

GRADIENTS = ("none", "stop_gradient", "soft", "transport")
MOTION_GRADIENTS = ("pathwise", "score")


@jax.custom_jvp
def with_gradient_of(value: jax.Array, source: jax.Array) -> jax.Array:
    """``value``, which ``source`` of the same shape gives its own derivative on top.

    The same as ``value + (source - stop_gradient(source))``, but the forward pass computes
    nothing of it, and a ``source`` that is -inf does no harm.
    """
    return value


@with_gradient_of.defjvp
def _with_gradient_of_jvp(primals, tangents):
    return primals[0], tangents[0] + tangents[1]


def weighted(share: jax.Array, log_weights: jax.Array) -> jax.Array:
    """``share * log_weights``, and 0 where the share is."""
    return share * jnp.where(share > 0, log_weights, 0.0)


def barrier(tree: Any) -> Any:
    """``lax.optimization_barrier`` whose integers and truth values have no derivative.

    JAX's own gives them one, which the next ``jnp.all`` has no rule for.
    """

    def cut(x):
        return x if jnp.issubdtype(x.dtype, jnp.inexact) else x | jnp.zeros_like(x)

    return jax.tree.map(cut, jax.lax.optimization_barrier(tree))


def check_motion_gradient(tracker: Any) -> None:
    """Refuse a gradient of the motion's parameters that would be zero whatever they are.

    For whoever differentiates with respect to the dynamics or the initial state.

    Raises:
        InputError: the likelihood is piecewise constant in the state (its ``state_gradient``
            is false) and the motion is differentiated along the particles' paths.
    """
    if tracker.motion_gradient == "pathwise" and not getattr(
        tracker.likelihood, "state_gradient", True
    ):
        raise InputError(
            f"{type(tracker.likelihood).__name__} does not change with the substate but in steps, "
            "so the gradient of motion parameters would always be zero; use its interpolated "
            "mode, or Partitioned(motion_gradient='score')."
        )


def check_gradient(tracker: Any, *, exchanges: bool) -> None:
    """Refuse variations that are unknown, or that cannot work with the tracker's other parts.

    Raises:
        InputError: an unknown name; ``score`` without ``log_density``; ``transport`` with
            an epsilon <= 0, or with what needs lineages.
    """
    for name, known in (("gradient", GRADIENTS), ("motion_gradient", MOTION_GRADIENTS)):
        if getattr(tracker, name) not in known:
            raise InputError(
                f"{name}={getattr(tracker, name)!r} is unknown; choose one of {', '.join(known)}."
            )
    if tracker.motion_gradient == "score" and not (
        hasattr(tracker.dynamics, "log_density") or hasattr(tracker.dynamics, "log_density_all")
    ):
        raise InputError(
            f"motion_gradient='score' needs the method log_density of the dynamics, and "
            f"{type(tracker.dynamics).__name__} has none; write it (see jaxpf.contract.Dynamics) "
            "or use motion_gradient='pathwise'."
        )
    if tracker.gradient != "transport":
        return
    epsilon = tracker.transport_epsilon
    if epsilon is not None and is_concrete(epsilon) and not np.all(np.asarray(epsilon) > 0):
        raise InputError(f"transport_epsilon={epsilon} must be above 0; None is the default, 0.5.")
    for used, what, remedy in (
        (exchanges, "a swap, which needs lineages", "swap='none'"),
        (tracker.ordering.by_label, "labels, which cannot be blended", "another ordering"),
        (tracker.tempering is not None, "tempering, whose weights cannot be blended", "None"),
        (
            hasattr(tracker.likelihood, "log_joint"),
            "log_joint, whose weighting functions belong to the particles before blending",
            "a likelihood that factors",
        ),
    ):
        if used:
            raise InputError(
                f"gradient='transport' blends particles and does not go with {what}; use {remedy} "
                "or gradient='stop_gradient'."
            )
