"""The evidence of frames that are missing, and its gradient, against Kalman at a few particles."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import COMPILER_OPTIONS, LIMIT, QUICK_RUNS, monte_carlo_once, problem, scores
from kalman_gradients import Gradients, exact_gradient, scaled
from labelled_targets import label_scores, mass_scores, mixture_score, recorded, targets

import jaxpf
from jaxpf import ordering
from jaxpf.gradients import Soft, StopGradient

pytestmark = pytest.mark.statistical

RUNS, BATCH = 20_000, 2_000
MISSING = (1, 2)
ORDERINGS = {"sir": (ordering.sir(1), (-1,)), "ps": (ordering.ps([0, 1]), (-1, -1))}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size", "motion"),
    [
        pytest.param("sir", 4, "score", marks=pytest.mark.always),
        ("sir", 4, "pathwise"),
        ("ps", 6, "pathwise"),
    ],
)
def test_the_gradient_of_the_evidence_is_unbiased(name, size, motion):
    order, parents = ORDERINGS[name]
    exact = problem(parents, num_frames=4, missing=MISSING)
    tracker = exact.tracker(
        order, num_particles=size, gradient=StopGradient(), motion_gradient=motion
    )

    def log_evidence(factors, key, frames):
        changed = dataclasses.replace(tracker, **scaled(tracker, factors))
        return jnp.sum(jaxpf.run(changed, key, frames)[1].log_evidence)

    def run(key):
        return jax.value_and_grad(log_evidence)(jnp.ones(3), key, exact.frames)

    every = jax.jit(
        lambda keys: jax.lax.map(run, keys, batch_size=BATCH), compiler_options=COMPILER_OPTIONS
    )
    totals, gradient = every(jax.random.split(jax.random.key(1), RUNS))
    evidence = np.exp(np.asarray(totals) - exact.log_evidence.sum())
    found = Gradients(evidence, evidence[:, None] * gradient, exact_gradient(exact))
    print(found)
    assert found.worst < LIMIT


def test_soft_resampling_is_unbiased():
    exact = problem((-1,), num_frames=4, missing=MISSING)
    settings = {"num_particles": 6, "gradient": Soft(0.1)}
    found = scores(exact, ordering.sir(1), runs=QUICK_RUNS, run=monte_carlo_once, **settings)
    print(found)
    assert found.worst < LIMIT


@pytest.mark.slow
def test_labels_that_are_selected_by_equal_shares_are_unbiased():
    exact = targets(missing=MISSING, num_frames=4)
    found = recorded(exact, weights="corrected")
    print(mixture_score(exact, found), mass_scores(exact, found), label_scores(exact, found))
    assert abs(mixture_score(exact, found)) < LIMIT
    assert np.abs(mass_scores(exact, found)).max() < LIMIT
