"""Linear-Gaussian problems with a known answer, and z-scores of a filter against it.

``Z^``, ``Z^ m^`` and ``Z^ E^[x^2]`` of a properly weighted filter are unbiased at any number
of particles.  A z-score is the distance of their mean over many runs from the exact value,
in standard errors of that mean: for a correct filter |z| is a draw from |N(0, 1)|.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from correlated import CorrelatedGaussian

import jaxpf
from jaxpf.dynamics import IndependentGaussian, LinearGaussian
from jaxpf.likelihoods import Gaussian, kalman, stacked_model

NUM_PARTICLES = 48
RUNS = 20_000
#: Of quick tests: ``test_mutations`` shows that fewer throw every known fault out.
QUICK_RUNS = 6_000
BATCH = 2_000
#: About one in 150 000 per statistic, if the filter is right; seeds are fixed.
LIMIT = 4.5
#: What a wrong filter must exceed.
WRONG = 10.0

TREE = (-1, 0, 0)
DEEP_TREE = (-1, 0, 0, 1, 2)
FOREST = (-1, -1, 0, 1)
OBJECTS = (-1, -1, -1, -1)
#: Orderings of the parts of ``TREE``.
ORDERINGS = {
    "sir": jaxpf.ordering.sir(3),
    "ps-012": jaxpf.ordering.ps([0, 1, 2]),
    "ps-021": jaxpf.ordering.ps([0, 2, 1]),
    "dps": jaxpf.ordering.dps(orders=[[0, 1, 2], [0, 2, 1]]),
    "sps-none": jaxpf.ordering.sps(TREE, "none"),
    "sps-random": jaxpf.ordering.sps(TREE, "random"),
    "sps-combinatorial": jaxpf.ordering.sps(TREE, "combinatorial"),
}


class Problem(NamedTuple):
    """A model, three frames, and the exact posterior of every frame.

    ``log_evidence`` is ``[T]``; ``mean`` and ``variance`` are ``[T, P]``, given the frames so far;
    ``smoothed_mean`` and ``smoothed_variance`` given all frames.
    """

    dynamics: Any
    likelihood: Any
    parents: tuple[int, ...]
    initial: Any
    frames: np.ndarray
    log_evidence: np.ndarray
    mean: np.ndarray
    variance: np.ndarray
    smoothed_mean: np.ndarray
    smoothed_variance: np.ndarray

    def tracker(self, ordering, **settings):
        settings = {"num_particles": NUM_PARTICLES} | settings
        return jaxpf.Partitioned(
            dynamics=self.dynamics,
            likelihood=self.likelihood,
            ordering=ordering,
            initial=self.initial,
            parents=self.parents,
            **settings,
        )


def problem(
    parents,
    *,
    transition=0.9,
    coupling=0.5,
    lag=None,
    initial_scale=None,
    correlation=None,
    same_frames=False,
    num_frames=3,
    missing=(),
    hidden=(),
) -> Problem:
    """``x^k_t = transition x^k_{t-1} + lag x^k_{t-2} + coupling parent_t + n``, ``y = x + n``.

    Noises are of unit variance; with a ``correlation``, the observation noise is correlated
    between partitions and the likelihood does not factor.  Frames ``missing`` are NaN, and so are
    single (frame, partition) that are ``hidden``.
    """
    size = len(parents)
    blocks = np.ones((size, 1, 1))
    has_parents = any(parent >= 0 for parent in parents)
    dynamics = LinearGaussian(
        transition=transition * blocks,
        noise=blocks,
        lag=None if lag is None else lag * blocks,
        coupling=coupling * blocks if has_parents else None,
    )
    covariance = np.eye(size)
    if correlation is not None:
        covariance = (1 - correlation) * np.eye(size) + correlation
    frames = 1.5 * np.random.default_rng(0).normal(size=(num_frames, size))
    if same_frames:
        frames = np.repeat(frames[:, :1], size, axis=1)
    frames[list(missing)] = np.nan
    for place in hidden:
        frames[place] = np.nan
    system, process = stacked_model(dynamics, parents)
    start = np.zeros((2 * size, 2 * size))
    initial: Any = np.zeros((size, 1))
    if initial_scale is not None:
        initial = IndependentGaussian(mean=np.zeros((size, 1)), scale=np.array(initial_scale))
        # Before the first frame both lags hold the same draw.
        start = initial_scale**2 * np.kron(np.ones((2, 2)), np.eye(size))
    log_evidence, mean, posterior = kalman(
        system,
        process,
        np.hstack([np.eye(size), np.zeros((size, size))]),
        covariance,
        np.zeros(2 * size),
        start,
        frames,
    )
    smoothed_mean, smoothed = rauch_tung_striebel(system, process, mean, posterior)
    factors = correlation is None
    return Problem(
        dynamics=dynamics,
        likelihood=Gaussian(noise=blocks) if factors else CorrelatedGaussian(covariance),
        parents=tuple(parents),
        initial=initial,
        frames=frames[..., None] if factors else frames,
        log_evidence=log_evidence,
        mean=mean[:, :size],
        variance=np.diagonal(posterior, axis1=1, axis2=2)[:, :size],
        smoothed_mean=smoothed_mean[:, :size],
        smoothed_variance=np.diagonal(smoothed, axis1=1, axis2=2)[:, :size],
    )


def rauch_tung_striebel(transition, process_covariance, means, covariances):
    """Exact smoothing of ``kalman``'s answer: means ``[T, S]`` and covariances ``[T, S, S]``."""
    smoothed_means, smoothed = [means[-1]], [covariances[-1]]
    for mean, covariance in zip(means[-2::-1], covariances[-2::-1], strict=True):
        predicted = transition @ covariance @ transition.T + process_covariance
        # With both lags in the state a prediction may have no full rank.
        gain = covariance @ transition.T @ np.linalg.pinv(predicted, hermitian=True)
        smoothed_means.append(mean + gain @ (smoothed_means[-1] - transition @ mean))
        smoothed.append(covariance + gain @ (smoothed[-1] - predicted) @ gain.T)
    return np.array(smoothed_means[::-1]), np.array(smoothed[::-1])


def objects(**changes) -> Problem:
    """Four independent objects with a second-order motion and an uncertain start."""
    settings = {"transition": 0.7, "lag": 0.3, "initial_scale": 1.0}
    return problem(OBJECTS, **(settings | changes))


def moments(state, summary):
    """The one ``record`` of all tests here, so that they share compiled kernels."""
    weights = jnp.exp(state.log_weights)
    values = state.substates[..., 0]
    return summary.log_evidence, weights @ values, weights @ values**2, summary.distinct_share


class Scores(NamedTuple):
    """z-scores of the evidence ``[]``, and of means and second moments ``[P]``."""

    evidence: float
    means: np.ndarray
    seconds: np.ndarray

    @property
    def worst(self) -> float:
        """The largest absolute z-score; infinite if one is not a number."""
        scores = np.abs(np.concatenate([[self.evidence], self.means, self.seconds]))
        return float(np.nan_to_num(scores, nan=np.inf).max())


def z(samples, expected):
    """Distance of the samples' mean from what is expected, in standard errors."""
    return (samples.mean(0) - expected) / (samples.std(0) / len(samples) ** 0.5)


def scores_of(recorded, exact: Problem) -> Scores:
    """Compare what ``moments`` recorded, leading axes ``[R, T]``, with the exact answer."""
    log_evidence, mean, second = (np.asarray(part) for part in recorded[:3])
    assert log_evidence.dtype == np.float64
    ratio = np.exp(log_evidence.sum(1) - exact.log_evidence.sum())
    return Scores(
        evidence=float(z(ratio, 1.0)),
        means=z(ratio[:, None] * mean[:, -1], exact.mean[-1]),
        seconds=z(ratio[:, None] * second[:, -1], exact.variance[-1] + exact.mean[-1] ** 2),
    )


#: Little more to compile than without, and much less to run many times.
COMPILER_OPTIONS = {"xla_backend_optimization_level": 1}


#: ``jaxpf.monte_carlo``; pass ``record`` and ``batch_size`` by name.
monte_carlo = jax.jit(
    jaxpf.monte_carlo,
    static_argnames=("record", "batch_size"),
    compiler_options=COMPILER_OPTIONS,
)
#: For a kernel of one or two tests: two seconds less to compile, and a second more for 6000 runs.
monte_carlo_once = jax.jit(jaxpf.monte_carlo, static_argnames=("record", "batch_size"))


def record_runs(
    exact: Problem, ordering, *, seed=1, runs=RUNS, batch=BATCH, run=monte_carlo, **settings
):
    """``moments`` of many runs of a filter on a problem, leading axes ``[R, T]``."""
    tracker = exact.tracker(ordering, **settings)
    keys = jax.random.split(jax.random.key(seed), runs)
    seen = ~np.isnan(exact.frames).reshape(len(exact.frames), -1)
    # Frames that are missing as a whole say so themselves.
    observed = seen if (seen.any(1) > seen.all(1)).any() else None
    # Batch by batch: any number of runs is the same compiled kernel.
    recorded = [
        run(tracker, some, exact.frames, record=moments, batch_size=batch, observed=observed)
        for some in keys.reshape(-1, batch)
    ]
    return jax.tree.map(lambda *parts: np.concatenate(parts), *recorded)


def scores(exact: Problem, ordering, **settings) -> Scores:
    """Run a filter many times on a problem and compare it with the exact answer."""
    return scores_of(record_runs(exact, ordering, **settings), exact)
