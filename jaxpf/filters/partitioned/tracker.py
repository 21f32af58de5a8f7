"""The partitioned particle filter as a tracker: its checks, ``init`` and ``step``."""

from collections.abc import Iterator
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import Tracker, calls
from jaxpf.contract.calls import coupled_with, look_near, observe_nearby, optional
from jaxpf.contract.errors import Argument, InputError, check_separate, choice
from jaxpf.contract.model import check_tree
from jaxpf.contract.options import check_fields
from jaxpf.contract.pytree import compiled_alone, is_concrete, pytree_dataclass
from jaxpf.contract.refusals import Bias, poisoned, refused
from jaxpf.contract.state import ParticleState, Summary, moments
from jaxpf.filters import confidence
from jaxpf.filters.initial import check_rows, draw_initial, initial_rows
from jaxpf.filters.partitioned import kernel, labels, levels, motion
from jaxpf.filters.partitioned.carry import Settings
from jaxpf.gradients import check_gradients
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.lowering.threefry import with_written_out_key
from jaxpf.resampling.schemes import scheme_of


@pytree_dataclass
class Partitioned(Settings, Tracker):
    """Partitioned particle filter: SIR, PS, DPS, SPS or branched, by its ordering.

    Example::

        tracker = jaxpf.Partitioned(
            dynamics=jaxpf.dynamics.RandomWalk(0.5),
            likelihood=likelihood,
            ordering=jaxpf.ordering.dps(2),
            initial=jnp.zeros((2, 2)),  # two partitions of two numbers
            num_particles=500,
        )

    Attributes:
        dynamics: see ``jaxpf.contract.Dynamics``.
        likelihood: see ``jaxpf.contract.Likelihood``.  If it defines ``log_joint``, ``log_prob`` is
            the weighting function of weighted resampling, and the final weights are corrected by
            the joint likelihood (maccormick1999, figure 8).
        ordering: from ``jaxpf.ordering``; traced, so switching it needs no recompilation.
        initial: state just before the first frame: ``[P, D]`` array, or a sampler
            ``key -> [P, D]`` registered as a pytree (for a function, by ``jax.tree_util.Partial``).
        initial_label: ``[L]``, probabilities of a particle's discrete label just before the first
            frame; None if particles carry no labels.  A label follows its particle, and selects its
            order in a branched ordering.  If defined, ``dynamics.propagate_label`` moves it and
            ``likelihood.log_joint_labelled`` receives it.
        tempering: exponent a in (0, 1] of the weighting functions ``g = p^a``; smaller values
            reduce impoverishment but increase the variance of the weights.  ``None`` is 1.
        ess_threshold: resample only if the effective sample size is at most this share of the
            particles; ``None`` always resamples.
        joint_weighting: static, whether each stage weights by the joint likelihood instead of
            ``log_prob``, with later partitions at the substates that ``dynamics.predict`` gives;
            see ``jaxpf.filters.partitioned.weighing``.
        proposal: a ``jaxpf.contract.Proposal`` that draws substates in place of the dynamics, such
            as those in ``jaxpf.proposals``.  A stage's weight is then likelihood times transition
            density over proposal density.  None draws from the dynamics.
        resampling: a name in ``jaxpf.resampling.SCHEMES``, or a custom scheme, see there.
        gradient: gradient strategy for resampling, from ``jaxpf.gradients``.
        parents: static, the part tree of the model, -1 for a root; default all roots.
        num_particles: static, N.
        keep_ancestors: static, whether states hold the particles' ancestors, ``state.sources``,
            which a ``record`` may keep; ``jaxpf.smooth(..., method="genealogy")`` sets it.
        motion_gradient: static, gradient strategy for the motion, one of
            ``jaxpf.gradients.MOTION_GRADIENTS``.
        refused: set by the constructor: ``[]`` bool, whether values that are traced there, in a
            user's ``jit``, ``vmap`` or ``scan``, do not work with the rest.  Summaries are then
            NaN with ``STATUS_UNSUPPORTED``.  None if all are known, and were checked.
    """

    def __post_init__(self):
        tree = (-1,) * self.ordering.num_partitions if self.parents is None else self.parents
        object.__setattr__(self, "parents", check_tree(tree))
        initial = initial_rows(self.initial, self.ordering.num_partitions)
        object.__setattr__(self, "initial", initial)
        object.__setattr__(self, "resampling", scheme_of(self.resampling))
        object.__setattr__(self, "refused", _check(self))

    @property
    def evidence_biases(self) -> tuple[Bias, ...]:
        """See ``jaxpf.contract.evidence_biases``."""
        ordering, exchanging = self.ordering, levels.may_exchange(self)
        has_parts = any(parent >= 0 for parent in self.parents)
        is_coupled = calls.is_coupled(calls.first_motion(self.dynamics))
        return (
            Bias(exchanging & ordering.exchanges_best, "swap='sorted'", "swap='combinatorial'"),
            Bias(
                exchanging & has_parts & ordering.exchanges_roots,
                "an exchange of roots that have parts",
                "sps(..., exchange_roots=False)",
                gross=False,
            ),
            Bias(
                exchanging & ordering.known.forgets_coupling & is_coupled,
                "ordering.blocks of coupled dynamics",
                "ordering.ps",
                gross=False,
            ),
            Bias(
                ordering.known.literal & ordering.divides,
                "reassembly='literal'",
                "reassembly='evidence'",
                gross=False,
            ),
            Bias(self.gradient.blends, "gradient Transport", "another gradient", False),
        )

    @compiled_alone
    @with_written_out_key
    def init(self, key: jax.Array) -> ParticleState:
        """Draw the state just before the first frame, with equal weights."""
        values = draw_initial(self.initial, key, self.num_particles)
        chex.assert_axis_dimension(values, 1, self.num_partitions)
        shape = (self.num_partitions, self.num_particles)
        path_scores = jnp.zeros(shape, values.dtype) if self.gradient.keeps_scores else None
        label = None
        if self.initial_label is not None:
            label_key = jax.random.fold_in(key, self.num_particles)
            label, score = labels.draw_first(self, label_key, values.dtype)
            if path_scores is not None:
                shares = jnp.broadcast_to(score / self.num_partitions, shape)
                path_scores = with_gradient_of(path_scores, shares)
        return ParticleState(
            lagged=jnp.stack([values, values]),
            log_weights=jnp.full((self.num_particles,), -np.log(self.num_particles), values.dtype),
            lineage=jnp.broadcast_to(jnp.arange(self.num_particles, dtype=jnp.int32), shape),
            component=jnp.zeros((self.num_particles,), jnp.int32),
            weighted=jnp.zeros((), bool),
            path_scores=path_scores,
            label=label,
            presence=confidence.at_start(self.likelihood, self.num_partitions, values.dtype),
            sources=jnp.zeros(shape, jnp.int32) if self.keep_ancestors else None,
            time=jnp.zeros((), jnp.int32),
        )

    def observe(self, frame: Any) -> Any:
        """Do the work that depends on the frame alone; unbatched when runs are vmapped."""
        return self.likelihood.observe(frame)

    def observe_nearby(self, frame: Any, state: ParticleState) -> Any:
        """See ``jaxpf.contract.calls.observe_nearby``; a proposal may look anywhere."""
        if self.proposal is not None:
            return None
        return observe_nearby(self.likelihood, frame, _means(state))

    @with_written_out_key
    def step_observed(
        self, key: jax.Array, state: ParticleState, observation: Any
    ) -> tuple[ParticleState, Summary]:
        """Advance by one observed frame: resample, then propagate and weight every partition."""
        chex.assert_shape(state.lagged, (2, None, self.num_partitions, self.num_particles))
        observation = look_near(self.likelihood, observation, lambda: _means(state))
        return poisoned(self.refused, kernel.step(self, key, state, observation))


def _means(state: ParticleState) -> jax.Array:
    """The estimates of the previous frame, ``[P, D]``."""
    return moments(state.lagged[0], jnp.exp(state.log_weights), jnp.matmul)[0].T


def _check(tracker: Settings) -> jax.Array | None:
    """Refuse settings that cannot work or would be silently wrong.

    Returns:
        Bool, whether traced values make one to refuse; None if they are known.
    """
    check_fields(tracker)
    check_gradients(tracker)
    ordering, parents = tracker.ordering, tracker.parents
    if len(parents) != ordering.num_partitions:
        raise InputError(
            f"parents has {len(parents)} parts but the ordering has {ordering.num_partitions}; "
            "give both the same number of partitions."
        )
    blends = tracker.keep_ancestors and tracker.gradient.blends
    check_separate("keep_ancestors=True", (blends, "gradient Transport, which blends particles"))
    check_rows(tracker.dynamics, ordering.num_partitions)
    labels.check(tracker)
    if tracker.joint_weighting:
        check_separate(
            "joint_weighting",
            (any(parent >= 0 for parent in parents), "a part tree"),
            (tracker.motion_gradient != "pathwise", f"motion_gradient={tracker.motion_gradient!r}"),
        )
    return refused(*_of_ordering(tracker), *_of_exchange(tracker), *motion.cases(tracker))


def _of_ordering(tracker: Settings) -> Iterator[tuple[Any, tuple[str | Argument, ...]]]:
    """Cases in which the ordering's components do not fit the rest, for ``refused``."""
    ordering = tracker.ordering.known
    used = (ordering.fractions > 0).sum(-1)
    yield (
        used > tracker.num_particles,
        (
            f"num_particles={tracker.num_particles} is fewer than the {_largest(used)} components "
            "of the ordering; use at least one particle per component.",
        ),
    )
    for part, parent in enumerate(tracker.parents):
        if parent < 0:
            continue
        before = ordering.rank[..., part] < ordering.rank[..., parent]  # [C]; padding repeats one
        order = ordering.order[before][0].tolist() if is_concrete(before) and before.any() else ""
        yield (
            before.any(-1),
            (
                f"the order {order} puts part {part} before its parent {parent}; put every parent "
                "first.",
            ),
        )
    if tracker.initial_label is not None and ordering.keeps_components:
        num_labels = np.shape(tracker.initial_label)[0]
        yield (
            used < num_labels,
            (
                f"initial_label has {num_labels} labels, but the ordering has {_largest(used)} "
                "branches; give it an order for each label.",
            ),
        )


def _of_exchange(tracker: Settings) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """Cases in which an exchange does not work or would be biased, for ``refused``."""
    ordering, likelihood = tracker.ordering.known, type(tracker.likelihood).__name__
    swap, none = ordering.swap_shown, choice("swap", "none")
    tree, parents = ordering.tree, np.array(tracker.parents, np.int32)
    for applies, reason in (
        (tracker.gradient.blends, "needs lineages, and gradient Transport blends particles"),
        (
            calls.has_log_joint(tracker.likelihood),
            f"needs a likelihood of single objects, and {likelihood} has log_joint",
        ),
        (
            tracker.tempering is not None,
            f"needs equal weights, and tempering={tracker.tempering} leaves them unequal",
        ),
        (
            tracker.moves_labels,
            "separates a particle's parts, on which its label depends by propagate_label",
        ),
    ):
        if applies:
            yield ordering.exchanges, (swap, f" {reason}; use ", none, " or another ordering.")
    if calls.is_coupled(calls.first_motion(tracker.dynamics)):
        yield (
            ordering.exchanges & ~ordering.forgets_coupling,
            (*coupled_with(tracker.dynamics, swap), " Or use ordering.blocks, which is biased."),
        )
    yield (
        ordering.exchanges & (tree != parents).any(-1),
        (
            f"the ordering's part tree {tree.tolist() if is_concrete(tree) else ''} is unlike the "
            f"model's {parents.tolist()}; with ",
            swap,
            " both must be the same.",
        ),
    )
    if callable(tracker.initial) and not optional(tracker.initial, "independent"):
        yield (
            ordering.exchanges_roots,
            (
                swap,
                " exchanges roots, but the initial sampler may draw them jointly; use a sampler "
                "with the attribute independent=True, or sps(..., exchange_roots=False).",
            ),
        )


def _largest(counts: jax.Array) -> Any:
    return counts.max() if is_concrete(counts) else ""
