"""Gradients through resampling: what ``jax.grad`` of a particle filter means.

A resampling draws integers, which have no derivative.  ``Partitioned(gradient=...)`` chooses
what replaces it.  All four work with every scheme and component, and the first two with every
swap; ``Soft`` runs as with ``swap="none"``, and ``Transport`` refuses swaps.  x is a particle, w
its weight, g a likelihood, n a component's size.

``NoGradient()``
    Weights are differentiated, ancestors are not: the derivative of the weights is forgotten
    at every resampling.  Cheap, low variance, biased; the bias does not vanish with N.
``StopGradient()``
    After a resampling every weight is divided by its own stopped value: ancestor k gets
    ``w_k / (n stop(rho_k))``, so that the draw's score enters (Scibior & Wood 2021).  The
    forward pass is the same bit for bit, and the expected gradient of the *evidence* is exact
    wherever the evidence is unbiased.  The ratios telescope: a weight's derivative is that of
    ``log g`` summed along the particle's own past, as in Fisher's identity.  The kernel keeps that
    sum, one row per partition beside the lineage, and an exchanged part brings its own past's
    derivative along; this contains the ratios ``log g_k - log(n_g a_g)`` of the draws within
    groups (combinatorial resampling).  The variance grows with the number of frames: prefer short
    sequences and many runs.
``Soft(share=0.5)``
    Ancestors are drawn from ``share * rho + (1 - share) / n`` and weighted by the ratio, which
    is differentiable (Karkus, Hsu & Lee 2018).  The filter stays properly weighted; the
    derivative is that of the normalised weights, times the total before.  Some particles are
    wasted, and the bias shrinks with the share.  Weights are then never equal, so that ``sps``
    exchanges nothing.
``Transport(epsilon=0.5)``
    No draw: each particle becomes a mixture of all, by entropy-regularised optimal transport
    (Corenflos et al. 2021).  Differentiable, biased, O(N^2).

The *motion* of the particles is differentiated along their paths (``motion_gradient=
"pathwise"``), which needs a likelihood that is differentiable in the state.  A likelihood of
whole pixels has a zero derivative almost everywhere, and so have noise scales then.
``motion_gradient="score"`` stops the drawn substates and gives the weights the derivative of
``dynamics.log_density`` at them instead; together with ``StopGradient`` it is exact in expectation
for any likelihood.  With a proposal, only the transition density is differentiated that way.

*Labels* are draws without a path: the weights get the derivative of ``dynamics.log_label``, if it
is defined, and with ``StopGradient`` that of ``initial_label``.
"""

from jaxpf.filters.gradients import (
    NoGradient,
    Soft,
    StopGradient,
    Transport,
    check_motion_gradient,
    named,
)
from jaxpf.names import GRADIENTS, MOTION_GRADIENTS

__all__ = [
    "GRADIENTS",
    "MOTION_GRADIENTS",
    "NoGradient",
    "Soft",
    "StopGradient",
    "Transport",
    "check_motion_gradient",
    "named",
]
