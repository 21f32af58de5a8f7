"""Particle filtering with factorised likelihoods: partitions are tracked independently.

Source: Patras and Pantic 2004, as described by eskil2014, section 2.2.  In every frame and for each
partition: simulate a move of all particles, weight the simulated moves, choose ancestors by these
weights, move the ancestors again, and weight.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.contract.refusals import Bias
from jaxpf.contract.state import Summary
from jaxpf.filters import confidence, options as of
from jaxpf.filters.factored import cloud
from jaxpf.filters.factored.cloud import Factored, FactoredState
from jaxpf.lowering.threefry import with_written_out_key


@pytree_dataclass
class PFFL(Factored):
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
        safety: share of the ancestors drawn by their weights alone, in (0, 1].
        form: static, ``"auxiliary"`` or ``"literal"``.

    The other fields are those of ``Factored``; eskil2014 has M = 50.
    """

    safety: of.Share = 0.1
    form: of.Form = static_field(default="auxiliary")

    @property
    def evidence_biases(self) -> tuple[Bias, ...]:
        """See ``jaxpf.contract.evidence_biases``."""
        return (Bias(self.form != "auxiliary", f"form={self.form!r}", "form='auxiliary'"),)

    @with_written_out_key
    def step_observed(
        self, key: jax.Array, state: FactoredState, observation: Any
    ) -> tuple[FactoredState, Summary]:
        """Advance by one observed frame; see the class."""
        observation = self.looking_near(state, observation)
        sample_key, simulate_key, choose_key, move_key = jax.random.split(key, 4)
        lagged, log_weights = state.lagged, state.log_weights
        if self.upsampling > 1 or self.form == "literal":
            lagged, log_weights = self.survivors(sample_key, state)
        simulated = self.moved(simulate_key, lagged)
        promise, invalid_before = self.weighed(observation, simulated)
        selection, _ = cloud.multiplied(log_weights, promise)
        if self.form == "auxiliary":
            safety = jnp.asarray(self.safety, selection.dtype)
            rest = jnp.log1p(-jnp.minimum(safety, 1 - jnp.finfo(safety.dtype).eps))
            selection = jnp.logaddexp(rest + selection, jnp.log(safety) + log_weights)
        ancestors, corrected = self.choose(choose_key, log_weights, selection)
        if self.form == "auxiliary":
            log_weights = corrected
        lagged, log_weights = self.upsampled(cloud.of_ancestors(lagged, ancestors), log_weights)
        new = self.moved(move_key, lagged)
        log_prob, invalid = self.weighed(observation, new)
        log_weights, totals = cloud.multiplied(log_weights, log_prob)
        after = FactoredState(
            lagged=jnp.stack([new, lagged[0]]),
            log_weights=log_weights,
            weighted=jnp.ones((), bool),
        )
        summary = cloud.summarise(after, totals, invalid + invalid_before)
        return confidence.reported(self.likelihood, state, after, summary, observation)
