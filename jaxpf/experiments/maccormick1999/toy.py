"""Figures 9 and 10: two targets of one dimension each, sampled together and one after another."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.experiments.claims import Claim, Quantity, judged, student_interval
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.media import plotting
from jaxpf.models.dynamics import RandomWalk
from jaxpf.models.likelihoods import Gaussian
from jaxpf.running import monte_carlo

#: The posterior is this much narrower than the spread of the dynamics.
_NARROWER = 8.0
_PARTICLES, _RUNS = 150, 40
_TARGET = (1.2, -0.8)


def particle_sets(seed: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Method -> substates ``[R, N, 2]`` and weights ``[R, N]`` after one frame."""
    noise = jnp.full((2, 1, 1), 1 / _NARROWER)
    frames = jnp.asarray(_TARGET).reshape(1, 2, 1)
    found = {}
    for name, ordering in (("SIR", orderings.sir(2)), ("PS", orderings.ps([0, 1]))):
        tracker = Partitioned(
            dynamics=RandomWalk(scale=1.0),
            likelihood=Gaussian(noise),
            ordering=ordering,
            initial=jnp.zeros((2, 1)),
            num_particles=_PARTICLES,
        )
        keys = jax.random.split(jax.random.key(seed), _RUNS)
        substates, log_weights = monte_carlo(tracker, keys, frames, _keep, batch_size=_RUNS)
        weights = np.exp(np.asarray(log_weights)[:, 0])
        found[name] = np.asarray(substates)[:, 0, :, :, 0], weights
    return found


def claims(sets: dict[str, tuple[np.ndarray, np.ndarray]]) -> list[Claim]:
    """That the partitioned set is finer."""
    ess = {name: 1 / (weights**2).sum(axis=1) for name, (_, weights) in sets.items()}
    gain = ess["PS"] / ess["SIR"]
    return [
        judged(
            "On the toy, the effective sample size of partitioned sampling is above the "
            "conventional filter's (ratio above 1)",
            "5, figures 9 and 10",
            "figure only",
            [Quantity("PS / SIR", float(gain.mean()), student_interval(gain), at_least=1.0)],
            digits=1,
        )
    ]


def figure(sets: dict[str, tuple[np.ndarray, np.ndarray]]) -> Any:
    """The last step of both figures, of one run."""
    drawing, axes = plotting.new_figure(1, 2, figsize=(10, 4.8))
    for axis, (name, (substates, weights)) in zip(axes[0], sets.items(), strict=True):
        a, b = substates[0].T
        ess = 1 / np.sum(weights[0] ** 2)
        axis.scatter(a, b, s=4000 * weights[0] / 4, facecolors="none", edgecolors="black")
        axis.plot(*_TARGET, "+", color="red", ms=14, mew=2)
        axis.set(
            xlim=(-3, 3), ylim=(-3, 3), xlabel="A", ylabel="B",
            title=f"{name}: effective sample size {ess:.1f} of {_PARTICLES}",
        )  # fmt: skip
    drawing.suptitle("Figures 9 and 10 repeated: areas are weights, the cross is the target")
    return drawing


def _keep(state: Any, summary: Any) -> Any:
    return state.substates, state.log_weights
