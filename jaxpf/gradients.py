"""Gradients through resampling: strategies for ``jax.grad`` of a particle filter.

Resampling draws integers, which have no derivative.  ``Partitioned(gradient=...)`` chooses a
strategy.  All four work with every scheme and with components.  ``NoGradient`` and
``StopGradient`` work with every swap; ``Soft`` treats every swap as ``"none"``, and ``Transport``
refuses swaps.  x is a particle, w its weight, rho its normalised weight, g a likelihood, n a
component's size.

``NoGradient()``
    Differentiates weights but not ancestors: every resampling drops the derivative of the
    weights.  Cheap, low variance, biased; the bias does not vanish with N.
``StopGradient()``
    Divides every weight by its own stopped value after resampling: ancestor k gets
    ``w_k / (n stop(rho_k))``, which adds the score of the draw (Scibior & Wood 2021).  The forward
    pass is unchanged bit for bit, and the expected gradient of the *evidence* is exact wherever
    the evidence is unbiased.  The ratios telescope: a weight's derivative is that of ``log g``
    summed along the particle's own past, as in Fisher's identity.  The kernel therefore keeps
    that sum, one row per partition beside the lineage, and an exchanged part brings the derivative
    of its own past; the sum contains the ratios ``log g_k - log(n_g a_g)`` of draws within groups
    (combinatorial resampling).  The variance grows with the number of frames: prefer short
    sequences and many runs.
``Soft(share=0.5)``
    Draws ancestors from ``share * rho + (1 - share) / n`` and weights them by the ratio, which is
    differentiable (Karkus, Hsu & Lee 2018).  The filter stays properly weighted.  The derivative
    is that of the normalised weights, times the total before.  Some particles are wasted; the bias
    shrinks with the share.  Weights are never equal, so ``sps`` runs without exchange, as with
    ``swap="none"``.
``Transport(epsilon=0.5)``
    Does not draw: each particle becomes a mixture of all particles, by entropy-regularised optimal
    transport (Corenflos et al. 2021).  Differentiable, biased, O(N^2).  Particles have no single
    ancestor, so it refuses every swap.

``motion_gradient="pathwise"`` differentiates the *motion* along the particles' paths.  It needs
draws that are differentiable in the parameters, not integers, and a likelihood that is
differentiable in the state.  A likelihood that reads whole pixels has zero
derivative almost everywhere, so the gradient of noise scales is wrongly zero.
``motion_gradient="score"`` stops the drawn substates and gives the weights the derivative of
``dynamics.log_density`` at them instead; with ``StopGradient`` it is exact in expectation for any
likelihood.
"""

import importlib.util
from typing import Any

import jax
from jax.typing import ArrayLike

from jaxpf.contract import calls
from jaxpf.contract.calls import check_uncoupled, optional
from jaxpf.contract.errors import InputError, check_separate
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.state import ParticleState
from jaxpf.contract.types import Differentiable
from jaxpf.resampling import transport, weighted
from jaxpf.resampling.components import Components

#: Names of strategies for the motion.
MOTION_GRADIENTS = ("pathwise", "score")


class Gradient:
    """Interface of a gradient strategy; the defaults change nothing."""

    #: Whether ``path_scores`` keeps the derivative of the weights along each particle's past.
    keeps_scores = False
    #: Whether a selection blends substates instead of drawing ancestors.
    blends = False
    #: Whether weights are equal after a selection, which exchange requires.
    equalises = True
    #: Settings of a tracker with which the strategy does not work.
    unsuited: tuple[str, ...] = ("joint_weighting",)

    def selection(self, log_weights: jax.Array, components: Components) -> jax.Array:
        """Return the log-weights ``[N]`` by which to draw ancestors."""
        return log_weights

    def selected(
        self, log_weights: jax.Array, before: jax.Array, components: Components
    ) -> jax.Array:
        """Return the log-weights ``[N]`` after a selection, given those ``before`` it."""
        return log_weights

    def check(self, tracker: Differentiable) -> None:
        """Refuse settings that are incompatible with the strategy.

        Raises:
            InputError: names the setting.
        """
        for name in self.unsuited:
            used = getattr(tracker, name, None)
            check_separate(name, (used, f"gradient {type(self).__name__}"))


@pytree_dataclass
class NoGradient(Gradient):
    """Differentiates weights but not ancestors."""

    def check(self, tracker: Differentiable) -> None:
        """See ``Gradient``: compatible with all settings."""


@pytree_dataclass
class StopGradient(Gradient):
    """Divides every weight by its own stopped value after resampling."""

    keeps_scores = True
    unsuited = ()


@pytree_dataclass
class Soft(Gradient):
    """Draws ancestors from a mixture of the weights and the uniform distribution.

    Attributes:
        share: share of the weights in the mixture, above 0 and at most 1.
    """

    share: ArrayLike = 0.5

    equalises = False

    def selection(self, log_weights: jax.Array, components: Components) -> jax.Array:
        """See ``Gradient``: returns the mixture."""
        return weighted.soft_selection(log_weights, self.share, components)

    def selected(
        self, log_weights: jax.Array, before: jax.Array, components: Components
    ) -> jax.Array:
        """See ``Gradient``: adds the derivative of the total before the selection."""
        return weighted.keep_total(log_weights, before, components)

    def check(self, tracker: Differentiable) -> None:
        """See ``Gradient``."""
        super().check(tracker)
        check_number("Soft's share", self.share, above=0, most=1)


@pytree_dataclass
class Transport(Gradient):
    """Turns each particle into a mixture of all; see ``jaxpf.resampling.transport``.

    Attributes:
        epsilon: strength of the entropy regularisation, above 0.
    """

    epsilon: ArrayLike = 0.5

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
        """See ``Gradient``: refuses settings that need ancestors or weights of single particles."""
        super().check(tracker)
        if importlib.util.find_spec("ott") is None:
            raise InputError(transport.MISSING)
        check_number("Transport's epsilon", self.epsilon, above=0)
        check_separate(
            "gradient Transport, which blends particles,",
            (tracker.ordering.keeps_components, "components that particles keep"),
            (tracker.initial_label is not None, "labels"),
            (tracker.tempering is not None, "tempering"),
            (calls.has_log_joint(tracker.likelihood), "a likelihood that has log_joint"),
        )


#: Strategies for resampling by name, with default parameters.
GRADIENTS: dict[str, Gradient] = {
    "none": NoGradient(),
    "stop_gradient": StopGradient(),
    "soft": Soft(),
    "transport": Transport(),
}


def check_gradients(tracker: Differentiable) -> None:
    """Refuse gradient settings that are incompatible with the rest of a tracker."""
    tracker.gradient.check(tracker)
    if tracker.motion_gradient == "score":
        check_uncoupled(tracker.dynamics, "motion_gradient='score'")


def check_motion_gradient(tracker: Any) -> None:
    """Refuse a gradient of parameters of the motion or the start that would always be zero.

    So it is along the particles' paths if the likelihood is piecewise constant in the state (its
    ``state_gradient`` is false).
    """
    moves = optional(tracker.likelihood, "state_gradient")
    if tracker.motion_gradient == "pathwise" and not moves:
        raise InputError(
            f"{type(tracker.likelihood).__name__} does not change with the substate but in steps, "
            "so the gradient of motion parameters would always be zero; use "
            "interpolation='bilinear' if it has it, otherwise motion_gradient='score'."
        )
