"""The partitioned particle filter as a tracker: ``init`` and ``step``, and what it refuses."""

from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.errors import InputError
from jaxpf.filters import resampling
from jaxpf.filters.partitioned import kernel, transport
from jaxpf.filters.partitioned.gradients import check_gradient
from jaxpf.filters.partitioned.ordering import SWAPS, Ordering, check_tree
from jaxpf.lowering.threefry import written_out
from jaxpf.pytree import as_array, is_concrete, pytree_dataclass, static_field
from jaxpf.state import ParticleState, Summary


@pytree_dataclass
class Partitioned:
    """Partitioned particle filter: SIR, PS, DPS, SPS or branched, by its ordering.

    Attributes:
        dynamics: see ``jaxpf.contract.Dynamics``.
        likelihood: see ``jaxpf.contract.Likelihood``.  If it has ``log_joint``, its
            ``log_prob`` is the weighting function of weighted resampling and the last
            weights are corrected by the joint likelihood (maccormick1999, figure 8).
        ordering: from ``jaxpf.ordering``; traced, changing it compiles nothing new.
        initial: ``[P, D]`` array, or a sampler ``key -> [P, D]`` registered as a pytree
            (``jax.tree_util.Partial`` makes one of a function).  It is the state just
            before the first frame.
        tempering: exponent a in (0, 1] of the weighting functions ``g = p^a``; smaller
            trades impoverishment for variance of the weights.  ``None`` is 1.
        ess_threshold: resample only where the effective sample size is at most this share
            of the particles; ``None`` always resamples.
        soft_share: share of the weights in the mixture of ``gradient="soft"``; None is 0.5.
        transport_epsilon: regularisation of ``gradient="transport"``; None is 0.5.
        parents: static, the part tree of the model, -1 for a root; default all roots.
        num_particles: static, N.
        resampling: static, one of ``jaxpf.resampling.SCHEMES``.
        gradient: static, what resampling passes on to a derivative, one of
            ``jaxpf.gradients.GRADIENTS``.
        motion_gradient: static, how the motion is differentiated, one of
            ``jaxpf.gradients.MOTION_GRADIENTS``.

    Raises:
        InputError: see ``check_tracker``.
    """

    dynamics: Any
    likelihood: Any
    ordering: Ordering
    initial: Any
    tempering: Any = None
    ess_threshold: Any = None
    soft_share: Any = None
    transport_epsilon: Any = None
    parents: Any = static_field(default=None)
    num_particles: int = static_field(default=300)
    resampling: str = static_field(default="systematic")
    gradient: str = static_field(default="none")
    motion_gradient: str = static_field(default="pathwise")

    def __post_init__(self):
        tree = (-1,) * self.ordering.num_partitions if self.parents is None else self.parents
        object.__setattr__(self, "parents", check_tree(tree))
        if not callable(self.initial):
            initial = as_array(self.initial)
            if not jnp.issubdtype(initial.dtype, jnp.floating):
                initial = initial.astype(jnp.result_type(float))
            object.__setattr__(self, "initial", initial)
        check_tracker(self)

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return self.ordering.num_partitions

    def init(self, key: jax.Array) -> ParticleState:
        """Draw the state just before the first frame, with equal weights."""
        key = written_out(key)
        if callable(self.initial):
            drawn = jax.vmap(self.initial)(jax.random.split(key, self.num_particles))
            chex.assert_rank(drawn, 3)
            values = jnp.moveaxis(drawn, (0, 1, 2), (2, 1, 0))
        else:
            values = jnp.broadcast_to(self.initial.T[..., None], (*self.initial.T.shape, 1))
            values = jnp.repeat(values, self.num_particles, axis=-1)
        chex.assert_axis_dimension(values, 1, self.num_partitions)
        shape = (self.num_partitions, self.num_particles)
        return ParticleState(
            lagged=jnp.stack([values, values]),
            log_weights=jnp.full((self.num_particles,), -np.log(self.num_particles), values.dtype),
            lineage=jnp.broadcast_to(jnp.arange(self.num_particles, dtype=jnp.int32), shape),
            component=jnp.zeros((self.num_particles,), jnp.int32),
            weighted=jnp.zeros((), bool),
            scores=jnp.zeros(shape, values.dtype) if self.gradient == "stop_gradient" else None,
        )

    def observe(self, frame: Any) -> Any:
        """Work that depends on the frame alone; stays unbatched when runs are vmapped."""
        return self.likelihood.observe(frame)

    def step(
        self, key: jax.Array, state: ParticleState, frame: Any
    ) -> tuple[ParticleState, Summary]:
        """One frame: resample, then propagate and weigh every partition.

        Args:
            key: this frame's random key; ``jaxpf.run`` uses ``fold_in(key, t)``.
            state: the weighted set of the frame before.
            frame: whatever the likelihood's ``observe`` takes.
        """
        return self.step_observed(key, state, self.observe(frame))

    def step_observed(
        self, key: jax.Array, state: ParticleState, observation: Any
    ) -> tuple[ParticleState, Summary]:
        """``step`` for a frame that was observed already."""
        chex.assert_shape(state.log_weights, (self.num_particles,))
        chex.assert_shape(state.lagged, (2, None, self.num_partitions, self.num_particles))
        if self.gradient == "transport":
            state = transport.blend_state(self, state)
        begin_key, stages_key = jax.random.split(written_out(key))
        components, carry = kernel.begin(self, begin_key, state)
        body = kernel.stage_body(self, stages_key, state, observation, components)
        carry = lax.fori_loop(0, self.num_partitions, body, carry)
        return kernel.finish(self, observation, components, carry)


def check_tracker(tracker: Partitioned) -> None:
    """Refuse what cannot work, or would be silently wrong.

    Raises:
        InputError: unknown resampling scheme; fewer particles than components; an initial
            state of another shape; an order that puts a child before its parent; a swap
            together with ``log_joint``, tempering, an unlike tree or jointly drawn roots.
    """
    resampling.check_scheme(tracker.resampling)
    exchanged = is_concrete(tracker.ordering) and np.asarray(tracker.ordering.exchanged).any()
    check_gradient(tracker, exchanges=bool(exchanged))
    for name, least in (
        ("tempering", "above 0"),
        ("soft_share", "above 0"),
        ("ess_threshold", "at least 0"),
    ):
        value = getattr(tracker, name)
        if value is None or not is_concrete(value):
            continue
        if np.any(np.asarray(value) > 1) or not np.all(
            np.asarray(value) >= 0 if name == "ess_threshold" else np.asarray(value) > 0
        ):
            raise InputError(f"{name}={value} must be {least} and at most 1; None is the default.")
    ordering, parents = tracker.ordering, tracker.parents
    if len(parents) != ordering.num_partitions:
        raise InputError(
            f"parents has {len(parents)} parts but the ordering has {ordering.num_partitions}; "
            "give both the same number of partitions."
        )
    if not callable(tracker.initial):
        shape = np.shape(tracker.initial)
        if len(shape) != 2 or shape[0] != ordering.num_partitions:
            raise InputError(
                f"initial has shape {shape}; it must be [P, D] with P = {ordering.num_partitions} "
                "partitions, or a sampler key -> [P, D]."
            )
    if not is_concrete(ordering) or np.ndim(ordering.order) != 2:
        return
    used = int(np.count_nonzero(np.asarray(ordering.fractions)))
    if tracker.num_particles < max(used, 1):
        raise InputError(
            f"num_particles={tracker.num_particles} is fewer than the {used} components of the "
            "ordering; use at least one particle per component."
        )
    for component, ranks in enumerate(np.asarray(ordering.rank)[:used]):
        for part, parent in enumerate(parents):
            if parent >= 0 and ranks[part] < ranks[parent]:
                raise InputError(
                    f"the order {np.asarray(ordering.order)[component].tolist()} puts part {part} "
                    f"before its parent {parent}; put every parent first."
                )
    if np.asarray(ordering.exchanged).any():
        _check_exchange(tracker)


def _check_exchange(tracker: Partitioned) -> None:
    ordering = tracker.ordering
    swap = SWAPS[int(ordering.swap)]
    tree = tuple(np.asarray(ordering.tree).tolist())
    if hasattr(tracker.likelihood, "log_joint"):
        raise InputError(
            f"swap={swap!r} needs a likelihood that factors over partitions, and this one has "
            "log_joint; use swap='none' or another ordering."
        )
    if tracker.tempering is not None:
        raise InputError(
            f"swap={swap!r} needs equal weights, and tempering={tracker.tempering} leaves them "
            "unequal; use tempering=None or swap='none'."
        )
    if tree != tracker.parents:
        raise InputError(
            f"the ordering's part tree {list(tree)} is unlike the model's {list(tracker.parents)}; "
            f"with swap={swap!r} both must be the same."
        )
    # In NumPy: JAX would compile a program for every one of these operations.
    is_root = np.asarray(ordering.tree)[np.asarray(ordering.order)[0]] < 0
    roots_exchanged = bool((np.asarray(ordering.exchanged) & is_root).any())
    independent = not callable(tracker.initial) or getattr(tracker.initial, "independent", False)
    if roots_exchanged and not independent:
        raise InputError(
            f"swap={swap!r} exchanges roots, but the initial sampler may draw them jointly; use a "
            "sampler with the attribute independent=True, or sps(..., exchange_roots=False)."
        )
