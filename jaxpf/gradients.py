"""Gradients through resampling: what ``jax.grad`` of a particle filter means.

A resampling draws integers, which have no derivative.  ``Partitioned(gradient=...)`` says
what stands in for it; all four compose with every scheme and component, and the first two
with every swap: ``Soft`` runs it as none, and ``Transport`` refuses it.  x is a particle, w its
weight, g a likelihood, n a component's size.

``NoGradient()``
    Weights are differentiated, ancestors are not: the derivative of the weights is forgotten
    at every resampling.  Cheap, low variance, biased; the bias does not vanish with N.
``StopGradient()``
    After a resampling every weight is divided by its own stopped value: ancestor k gets
    ``w_k / (n stop(rho_k))``, so that the draw's score enters (Scibior & Wood 2021).  The
    forward pass is the same bit for bit, and the expected gradient of the *evidence* is exact
    wherever the evidence is unbiased.  The ratios telescope: a weight's derivative is that of
    ``log g`` summed along the particle's own past, which Fisher's identity asks for, too.
    So the kernel keeps that sum, one row per partition beside the lineage, and an exchanged
    part brings its own past's derivative along; this contains the ratios
    ``log g_k - log(n_g a_g)`` of the draws within groups (combinatorial resampling).  The
    variance grows with the number of frames: prefer short sequences and many runs.
``Soft(share=0.5)``
    Ancestors are drawn from ``share * rho + (1 - share) / n`` and weighted by the ratio, which
    is differentiable (Karkus, Hsu & Lee 2018).  The filter stays properly weighted; the
    derivative is that of the normalised weights, times the total before.  Some particles are
    wasted, and the bias shrinks with the share.  Weights are then never equal, so that the
    exchanges of ``sps`` are left out: it runs as with ``swap="none"``.
``Transport(epsilon=0.5)``
    No draw: each particle becomes a mixture of all, by entropy-regularised optimal transport
    (Corenflos et al. 2021).  Differentiable, biased, O(N^2), and nobody descends from one
    particle: refused with any swap.

The *motion* of the particles is differentiated along their paths (``motion_gradient=
"pathwise"``), which needs a likelihood that is differentiable in the state.  One that looks
at whole pixels has a zero derivative almost everywhere, and noise scales then get a gradient
of zero that looks like a result.  ``motion_gradient="score"`` stops the drawn substates and
gives the weights the derivative of ``dynamics.log_density`` at them instead; together with
``StopGradient`` it is exact in expectation for any likelihood.
"""

import importlib.util
from typing import Any

import jax
import numpy as np

from jaxpf import contract
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.interface import check_uncoupled
from jaxpf.contract.names import MOTION_GRADIENTS
from jaxpf.contract.pytree import is_concrete, pytree_dataclass
from jaxpf.contract.state import ParticleState
from jaxpf.resampling import transport, weighted
from jaxpf.resampling.components import Components


class Gradient:
    """What filters ask of a strategy; a strategy overrides what it does otherwise."""

    #: The derivative of a weight is kept along its particle's past, in ``path_scores``.
    keeps_scores = False
    #: A selection moves substates instead of drawing ancestors.
    blends = False
    #: A selection leaves equal weights, without which no parts are exchanged.
    equalises = True

    def selection(self, log_weights: jax.Array, components: Components) -> jax.Array:
        """By what ancestors are drawn, ``[N]``, given by what they would be."""
        return log_weights

    def selected(
        self, log_weights: jax.Array, before: jax.Array, components: Components
    ) -> jax.Array:
        """The weights ``[N]`` after a selection, given those ``before`` it."""
        return log_weights

    def check(self, tracker: Any) -> None:
        """Refuse what the strategy does not go with.

        Raises:
            InputError: the sentence says what.
        """
        for name in ("relocation", "look_ahead"):
            if getattr(tracker, name, None):
                raise InputError(
                    f"{name} does not go with gradient {type(self).__name__}; leave one of them "
                    "out."
                )


@pytree_dataclass
class NoGradient(Gradient):
    """Weights are differentiated, ancestors are not."""

    def check(self, tracker: Any) -> None:
        """See ``Gradient``: it goes with everything."""


@pytree_dataclass
class StopGradient(Gradient):
    """After a resampling every weight is divided by its own stopped value."""

    keeps_scores = True


@pytree_dataclass
class Soft(Gradient):
    """Ancestors are drawn from a mixture of the weights and equal ones.

    Attributes:
        share: of the weights in the mixture, above 0 and at most 1.
    """

    share: Any = 0.5

    equalises = False

    def selection(self, log_weights: jax.Array, components: Components) -> jax.Array:
        """See ``Gradient``: the mixture."""
        return weighted.soft_selection(log_weights, self.share, components)

    def selected(
        self, log_weights: jax.Array, before: jax.Array, components: Components
    ) -> jax.Array:
        """See ``Gradient``: with the derivative of their total before."""
        return weighted.keep_total(log_weights, before, components)

    def check(self, tracker: Any) -> None:
        """See ``Gradient``."""
        super().check(tracker)
        share = self.share if not is_concrete(self.share) else np.asarray(self.share)
        if is_concrete(share) and not 0 < np.min(share) <= np.max(share) <= 1:
            raise InputError(f"Soft's share {share} must be above 0 and at most 1.")


@pytree_dataclass
class Transport(Gradient):
    """Each particle becomes a mixture of all, by optimal transport; see ``filters.transport``.

    Attributes:
        epsilon: strength of the regularisation, above 0.
    """

    epsilon: Any = 0.5

    blends = True

    def blend(
        self,
        lagged: jax.Array,
        log_weights: jax.Array,
        components: Components,
        ess_threshold: Any = None,
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """See ``transport.blend``."""
        return transport.blend(self.epsilon, lagged, log_weights, components, ess_threshold)

    def blend_state(self, state: ParticleState, ess_threshold: Any = None) -> ParticleState:
        """See ``transport.blend_state``."""
        return transport.blend_state(self.epsilon, state, ess_threshold)

    def check(self, tracker: Any) -> None:
        """See ``Gradient``: nothing that needs ancestors, or weights that stay with a particle."""
        super().check(tracker)
        if importlib.util.find_spec("ott") is None:
            raise InputError(transport.MISSING)
        if is_concrete(self.epsilon) and not np.all(np.asarray(self.epsilon) > 0):
            raise InputError(f"Transport's epsilon {self.epsilon} must be above 0.")
        ordering = tracker.ordering
        exchanges = is_concrete(ordering) and np.asarray(ordering.exchanged).any()
        for used, what, remedy in (
            (exchanges, "a swap, which needs lineages", "swap='none'"),
            (
                ordering.keeps_components,
                "components that particles keep, which cannot be blended",
                "another ordering",
            ),
            (tracker.initial_label is not None, "labels, which cannot be blended", "no labels"),
            (tracker.tempering is not None, "tempering, whose weights cannot be blended", "None"),
            (
                contract.has_log_joint(tracker.likelihood),
                "log_joint, whose weighting functions belong to the particles before blending",
                "a likelihood that factors",
            ),
        ):
            if used:
                raise InputError(
                    f"gradient Transport blends particles and does not go with {what}; use "
                    f"{remedy} or gradient=jaxpf.gradients.StopGradient()."
                )


_NAMED = {
    "none": NoGradient,
    "stop_gradient": StopGradient,
    "soft": Soft,
    "transport": Transport,
}


def named(name: str) -> Gradient:
    """The strategy of a name of ``jaxpf.contract.names.GRADIENTS``, with its default parameters."""
    return _NAMED[name]()


def check_gradients(tracker: Any) -> None:
    """Refuse strategies that do not go with the rest of a tracker.

    Raises:
        InputError: no strategy, an unknown name, ``score`` without ``log_density``; see also
            ``Gradient.check``.
    """
    if not isinstance(tracker.gradient, Gradient):
        raise InputError(
            f"gradient={tracker.gradient!r} is no strategy of jaxpf.gradients; give "
            f"{', '.join(f'{one.__name__}()' for one in _NAMED.values())}."
        )
    tracker.gradient.check(tracker)
    check_known("motion_gradient=", tracker.motion_gradient, MOTION_GRADIENTS)
    if tracker.motion_gradient == "score":
        check_uncoupled(tracker.dynamics, "motion_gradient='score'")
    if tracker.motion_gradient == "score" and not contract.has_log_density(tracker.dynamics):
        raise InputError(
            f"motion_gradient='score' needs the method log_density of the dynamics, and "
            f"{type(tracker.dynamics).__name__} has none; write it (see "
            "jaxpf.contract.DynamicsWithDensity) or use motion_gradient='pathwise'."
        )


def check_motion_gradient(tracker: Any) -> None:
    """Refuse a gradient of the motion's parameters that would be zero whatever they are.

    For whoever differentiates with respect to the dynamics or the initial state.

    Raises:
        InputError: the likelihood is piecewise constant in the state (its ``state_gradient``
            is false) and the motion is differentiated along the particles' paths.
    """
    if tracker.motion_gradient == "pathwise" and not contract.has_state_gradient(
        tracker.likelihood
    ):
        raise InputError(
            f"{type(tracker.likelihood).__name__} does not change with the substate but in steps, "
            "so the gradient of motion parameters would always be zero; use its interpolated "
            "mode, or a tracker with motion_gradient='score'."
        )
