"""The examples in the docstrings of the package's own functions run."""

import inspect
import re
import textwrap

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import norm

import jaxpf
from jaxpf.likelihoods import Gaussian

#: Functions without an example, and why.
WITHOUT = {
    "Eskil": "built by jaxpf.points.tracker(method='eskil')",
    "InputError": "raised, never made by a user",
    "Labelled": "built by jaxpf.boxes.tracker(method='labelled')",
    "PFFL": "built by jaxpf.points.tracker(method='pffl')",
    "ParticleState": "returned",
    "Summary": "returned",
}
PUBLIC = {name: getattr(jaxpf, name) for name in jaxpf.__all__}
PUBLIC = {name: value for name, value in PUBLIC.items() if callable(value)}
#: Examples that compute for more than seconds.
SLOW = {"pmmh", "tune"}


def example(value):
    """The literal blocks of a docstring."""
    found = re.findall(r"::\n\n((?: {4}.*\n|\n)+)", inspect.getdoc(value) + "\n")
    return "\n".join(map(textwrap.dedent, found))


def initial(key, p):
    return jax.random.normal(key)


def transition(key, x, p):
    return p["a"] * x + jax.random.normal(key)


def log_likelihood(y, x, p):
    return norm.logpdf(y, x, 0.5)


def names(tmp_path):
    """What the examples take as given."""
    tracker = jaxpf.state_space(
        initial=initial,
        transition=transition,
        log_likelihood=log_likelihood,
        parameters={"a": 0.5},
        transition_log_density=lambda new, x, p: norm.logpdf(new, p["a"] * x),
        observation=lambda key, x, p: x + 0.5 * jax.random.normal(key),
    )
    key, y = jax.random.key(0), jnp.sin(jnp.arange(12.0))
    state, _ = jaxpf.run(tracker, key, y)
    jaxpf.save(tmp_path / "state.npz", state)
    return {
        **{"jax": jax, "jnp": jnp, "jaxpf": jaxpf, "tracker": tracker, "key": key, "y": y},
        **{"later": y, "state": state, "keys": jax.random.split(key, 3)},
        **{"initial": initial, "transition": transition, "log_likelihood": log_likelihood},
        "likelihood": Gaussian(jnp.broadcast_to(jnp.eye(2), (2, 2, 2))),
    }


def test_every_function_has_an_example():
    assert {name for name, value in PUBLIC.items() if not example(value)} == WITHOUT.keys()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in SLOW else [pytest.mark.always])
        for name in sorted(PUBLIC.keys() - WITHOUT.keys() - {"use_cores"})  # JAX has started here
    ],
)
def test_the_example_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(example(PUBLIC[name]), names(tmp_path))


@pytest.mark.slow
@pytest.mark.always
@pytest.mark.parametrize("kind", [jaxpf.boxes, jaxpf.points, jaxpf.parts, jaxpf.contours])
def test_the_example_of_a_kind_of_target_runs(kind):
    frames = np.random.default_rng(0).integers(0, 256, (3, 240, 320, 3), np.uint8)
    exec(example(kind.tracker), {"jax": jax, "jaxpf": jaxpf, "frames": frames})
