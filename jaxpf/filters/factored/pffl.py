"""Particle filtering with factorised likelihoods: partitions are tracked independently.

Source: Patras and Pantic 2004, as described by eskil2014, section 2.2.  In every frame and for each
partition: simulate a move of all particles, weight the simulated moves, choose ancestors by these
weights, move the ancestors again, and weight.
"""

from typing import Any

import chex
import jax
import jax.numpy as jnp

from jaxpf.contract import Tracker
from jaxpf.contract.calls import check_factors
from jaxpf.contract.options import check_fields
from jaxpf.contract.pytree import compiled_alone, pytree_dataclass, static_field
from jaxpf.contract.refusals import Bias
from jaxpf.contract.state import Summary
from jaxpf.filters import confidence, options as of
from jaxpf.filters.factored import cloud
from jaxpf.filters.factored.cloud import FactoredState
from jaxpf.filters.initial import check_rows, initial_rows
from jaxpf.lowering.threefry import with_written_out_key
from jaxpf.resampling.schemes import scheme_of


@pytree_dataclass
class PFFL(Tracker):
    """Particle filter with factorised likelihoods over P partitions, M particles for each.

    Let pi be the weights, lambda the likelihoods of the simulated moves and g those of the actual
    moves.  The forms are

    * ``"auxiliary"`` (default): draw ancestors by ``b = (1 - safety) lambda pi / sum(lambda pi) +
      safety pi``, with weights ``g pi / b``.  ``log_evidence`` belongs to an unbiased estimate at
      any number of particles.  Without the second term, the weights have infinite variance as soon
      as moves are wider than the likelihood.
    * ``"literal"``: sample by pi, choose by lambda, weight by g (eskil2014, steps 1 to 6, eq. 5).
      This uses the frame's evidence twice, in choosing ancestors and in weighting.  Estimates are
      biased towards the latest observation, and ``log_evidence`` is too large on average.

    Attributes:
        dynamics: see ``jaxpf.contract.Dynamics``; there are no parents.
        likelihood: see ``jaxpf.contract.Likelihood``; must factor over partitions.
        initial: ``[P, D]``, or a sampler ``key -> [P, D]``, just before the first frame.
        safety: share of the ancestors drawn by their weights alone, in (0, 1].
        num_particles: static, M per partition; 50 in eskil2014.
        upsampling: static, number of moves per ancestor; the next frame thins the set to M.
        form: static, ``"auxiliary"`` or ``"literal"``.
        resampling: a name in ``jaxpf.resampling.SCHEMES``, or a custom scheme, see there.
    """

    dynamics: Any
    likelihood: Any
    initial: Any
    safety: of.Share = 0.1
    num_particles: of.NumParticles = static_field(default=50)
    upsampling: of.Upsampling = static_field(default=1)
    form: of.Form = static_field(default="auxiliary")
    resampling: Any = "systematic"

    def __post_init__(self):
        object.__setattr__(self, "initial", initial_rows(self.initial))
        object.__setattr__(self, "resampling", scheme_of(self.resampling))
        check_fields(self)
        check_factors(self.dynamics, self.likelihood, "factored particles")
        check_rows(self.dynamics, self.num_partitions)

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return cloud.count_partitions(self.initial)

    @property
    def evidence_biases(self) -> tuple[Bias, ...]:
        """See ``jaxpf.contract.evidence_biases``."""
        return (Bias(self.form != "auxiliary", f"form={self.form!r}", "form='auxiliary'"),)

    @compiled_alone
    @with_written_out_key
    def init(self, key: jax.Array) -> FactoredState:
        """Draw the state just before the first frame, with equal weights."""
        return cloud.start(key, self)

    def observe(self, frame: Any) -> Any:
        """Do the work that depends on the frame alone."""
        return self.likelihood.observe(frame)

    @with_written_out_key
    def step_observed(
        self, key: jax.Array, state: FactoredState, observation: Any
    ) -> tuple[FactoredState, Summary]:
        """Advance by one observed frame; see the class."""
        chex.assert_shape(state.log_weights, (None, self.num_particles * self.upsampling))
        observation = cloud.seen_near(self, state, observation)
        sample_key, simulate_key, choose_key, move_key = jax.random.split(key, 4)
        lagged, log_weights = state.lagged, state.log_weights
        if self.upsampling > 1 or self.form == "literal":
            lagged, log_weights = cloud.survivors(self, sample_key, state)
        simulated = cloud.moved(self, simulate_key, lagged)
        promise, invalid_before = cloud.weighed(self, observation, simulated)
        selection, _ = cloud.multiplied(log_weights, promise)
        if self.form == "auxiliary":
            safety = jnp.asarray(self.safety, selection.dtype)
            rest = jnp.log1p(-jnp.minimum(safety, 1 - jnp.finfo(safety.dtype).eps))
            selection = jnp.logaddexp(rest + selection, jnp.log(safety) + log_weights)
        ancestors, corrected = cloud.choose(self, choose_key, log_weights, selection)
        if self.form == "auxiliary":
            log_weights = corrected
        lagged, log_weights = cloud.upsampled(
            cloud.taken(lagged, ancestors), log_weights, self.upsampling
        )
        new = cloud.moved(self, move_key, lagged)
        log_prob, invalid = cloud.weighed(self, observation, new)
        log_weights, totals = cloud.multiplied(log_weights, log_prob)
        after = FactoredState(
            lagged=jnp.stack([new, lagged[0]]),
            log_weights=log_weights,
            weighted=jnp.ones((), bool),
        )
        summary = cloud.summarise(after, totals, invalid + invalid_before)
        return confidence.reported(self.likelihood, state, after, summary, observation)
