"""What eq. 4 and the rest cost in exactness: linear-Gaussian targets, whose answers are known.

Two targets move by ``x_t = 1.5 x_{t-1} - .5 x_{t-2} + n`` and are observed with unit noise for a
few frames.  An unbiased estimate of an evidence, over the exact one, has the mean 1.
"""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.dynamics.gaussian import LinearGaussian
from jaxpf.likelihoods.gaussian import Gaussian, kalman
from jaxpf.papers.judging.claims import Measured, wilson
from jaxpf.papers.judging.comparison_table import Cell, Rows, Table
from jaxpf.papers.judging.estimates import mean_cell

TARGETS, PARTICLES, FRAMES, RUNS = 2, 16, 3, 20_000
_MOTION = 1.5, -0.5

VARIANTS: dict[str, dict[str, Any]] = {
    "plain": {"weights": "plain"},
    "eq. 4": {},
    "eq. 4, weights corrected": {"weights": "corrected"},
    "within labels": {"scope": "within"},
    "eq. 4, feedback": {"feedback": "estimate", "position": (0,)},
    "eq. 4, feedback, regularised": {
        "feedback": "estimate",
        "position": (0,),
        "regularise": np.array([0.9, 0.4], np.float32),
    },
}


def frames(seed: int = 0) -> np.ndarray:
    """Observations ``[T, L, 1]``; the second target fits its model less than the first."""
    drawn = np.random.default_rng(seed).normal(size=(FRAMES, TARGETS, 1))
    return (drawn * np.array([0.5, 1.5])[:, None]).astype(np.float32)


def exact(observed: np.ndarray) -> np.ndarray:
    """Log evidence ``[L]`` of each target by the Kalman filter."""
    system = np.array([_MOTION, (1.0, 0.0)])
    settings = np.diag([1.0, 0.0]), np.array([[1.0, 0.0]]), np.eye(1), np.zeros(2), np.zeros((2, 2))
    return np.array(
        [kalman(system, *settings, observed[:, target])[0].sum() for target in range(TARGETS)]
    )


def tracker(**changes: Any) -> jaxpf.Labelled:
    """The filter of both targets."""
    one = np.ones((TARGETS, 1, 1), np.float32)
    settings: dict[str, Any] = {"num_particles": PARTICLES, "resampling": "multinomial"}
    return jaxpf.Labelled(
        dynamics=LinearGaussian(transition=_MOTION[0] * one, lag=_MOTION[1] * one, noise=one),
        likelihood=Gaussian(noise=jnp.asarray(one)),
        initial=np.zeros((TARGETS, 1), np.float32),
        **(settings | changes),
    )


def measure(runs: int = RUNS, seed: int = 0) -> dict[str, dict[str, np.ndarray]]:
    """Variant -> what ``_record`` keeps of every run and frame."""
    keys = jax.random.split(jax.random.key(seed), runs)
    return {
        label: jaxpf.monte_carlo(
            tracker(**changes), keys, jnp.asarray(frames()), _record, min(runs, 2000)
        )
        for label, changes in VARIANTS.items()
    }


def bias_table(found: Mapping[str, Mapping[str, np.ndarray]]) -> Table:
    """Means of the evidence estimates over the exact ones, and how often a target is lost."""
    answer = exact(frames())
    rows: Rows = []
    for label, recorded in found.items():
        mixture, own, lost = (np.asarray(recorded[what], float) for what in _RECORDED)
        runs = len(mixture)
        ratios = np.exp(own.sum(axis=1) - answer)
        starved = float(lost[:, -1].any(axis=1).sum())
        rows.append(
            (
                label,
                [
                    Cell(None, Measured(100 * starved / runs, *wilson(starved, runs)(0.95)), 1),
                    mean_cell(np.exp(mixture.sum(axis=1)) / np.exp(answer).mean(), 3),
                    *(mean_cell(ratios[:, target], 3) for target in range(TARGETS)),
                    mean_cell(ratios.prod(axis=1), 3),
                ],
            )
        )
    return Table(
        "bias",
        "Beyond the paper: evidence over the exact one, linear-Gaussian targets (unbiased: 1)",
        ["", "a target lost (%)", "mixture", "target 1", "target 2", "product of both"],
        rows,
        f"{runs} runs of {PARTICLES} particles for {TARGETS} targets over {FRAMES} frames, "
        "multinomial resampling.",
    )


_RECORDED = ("log_evidence", "label_log_evidence", "lost")


def _record(state: Any, summary: Any) -> Any:
    lost = summary.uniqueness == 0
    return dict(
        zip(_RECORDED, (summary.log_evidence, summary.label_log_evidence, lost), strict=True)
    )
