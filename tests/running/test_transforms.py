"""Public functions inside a user's own transforms, with frames passed in, closed over, or NumPy."""

import dataclasses

import jax
import jax.numpy as jnp
import models
import numpy as np
import pytest
from records import only_estimate as final

import jaxpf
from jaxpf import ordering, smoothing, tuning
from jaxpf.dynamics import RandomWalk
from jaxpf.filters import SideBySide, WithErrorBars
from jaxpf.running import runs

KEY = jax.random.key(1)
FRAMES = np.random.default_rng(0).normal(size=(3, 2, 1)).astype(np.float32)
GAPS = FRAMES.copy()
GAPS[1] = np.nan


def partitioned(scale, **changes):
    settings = {"dynamics": RandomWalk(scale), "num_particles": 4, "resampling": "multinomial"}
    return models.partitioned(ordering.ps([0, 1]), **settings | changes)


def other(kind, scale, start=(0.0, 1.0)):
    changes = {"dynamics": RandomWalk(scale), "initial": np.float32(start)[:, None]}
    return kind(**models.walks() | changes)


TRACKERS = {
    "partitioned": partitioned,
    "labelled": lambda scale: other(jaxpf.Labelled, scale, (0.0, 0.0)),
    "eskil": lambda scale: other(jaxpf.Eskil, scale),
    "pffl": lambda scale: other(jaxpf.PFFL, scale),
    "error-bars": lambda scale: WithErrorBars(partitioned(scale)),
    "side-by-side": lambda scale: SideBySide(partitioned(scale), 2),
}


FUNCTIONS = {
    "run": lambda its, key, frames: jaxpf.run(its, key, frames, final)[1],
    "monte_carlo": lambda its, key, frames: jaxpf.monte_carlo(its, key[None], frames, final),
    "forecast": lambda its, key, frames: jaxpf.forecast(
        its, key, jaxpf.run(its, key, frames)[0], 2, final
    )[1],
    "step": lambda its, key, frames: runs.step(its, key, 0, its.init(key), frames[0])[1],
    "log_evidence": lambda its, key, frames: tuning.log_evidence(its, key[None], frames),
    "smooth": lambda its, key, frames: jaxpf.smooth(its, key, frames).estimate,
    "particle_gibbs": lambda its, key, frames: smoothing.particle_gibbs(its, key, frames, 2),
}
TRANSFORMS = {
    "jit": jax.jit,
    "grad": lambda f: jax.jit(jax.grad(f)),
    "vmap": lambda f: jax.jit(lambda x: jax.vmap(f)(jnp.stack([x, x]))),
    "scan": lambda f: lambda x: jax.lax.scan(lambda c, _: (c + f(x), None), 0.0, None, 2)[0],
    "fori_loop": lambda f: lambda x: jax.lax.fori_loop(0, 2, lambda _, c: c + f(x), 0.0),
    "checkpoint": lambda f: jax.grad(jax.checkpoint(f)),
    "make_jaxpr": lambda f: lambda x: (x, jax.make_jaxpr(f)(x))[0],
    "eval_shape": lambda f: lambda x: (x, jax.eval_shape(f, x))[0],
}


def total(tree):
    leaves = [jnp.asarray(x) for x in jax.tree.leaves(tree)]
    return sum(jnp.sum(x) for x in leaves if jnp.issubdtype(x.dtype, jnp.floating))


def trace(function, transform, source, make=partitioned, frames=GAPS):
    """Trace a transform of a function of one number, which a tracker is built with."""

    def result(scale, frames):
        return total(FUNCTIONS[function](make(scale), KEY, frames))

    def transformed(scale, given):
        return TRANSFORMS[transform](lambda x: result(x, given))(scale)

    if source == "passed":
        return jax.eval_shape(transformed, jnp.float32(1), frames)
    given = jnp.asarray(frames) if source == "closed over" else frames
    return jax.eval_shape(lambda scale: transformed(scale, given), jnp.float32(1))


#: Every function in every transform, and each of them with every source and every tracker.
PAIRS = [
    (function, transform, sources[(n + m) % 3], [*TRACKERS][(n - m) % len(TRACKERS)])
    for sources in [["passed", "closed over", "NumPy"]]
    for n, function in enumerate(FUNCTIONS)
    for m, transform in enumerate(TRANSFORMS)
]
QUICK = [
    ("monte_carlo", "jit", "closed over", "partitioned"),
    ("smooth", "jit", "closed over", "partitioned"),
    *(("run", transform, "closed over", "partitioned") for transform in ("grad", "vmap", "scan")),
    *(("run", "jit", "closed over", tracker) for tracker in ("labelled", "pffl")),
]


@pytest.mark.parametrize(
    ("function", "transform", "source", "tracker"),
    [*QUICK, *(pytest.param(*pair, marks=pytest.mark.slow) for pair in PAIRS if pair not in QUICK)],
)
def test_every_function_works_in_every_transform(function, transform, source, tracker):
    alone = function in ("smooth", "particle_gibbs")
    trace(function, transform, source, partitioned if alone else TRACKERS[tracker])


@pytest.mark.parametrize(
    "function", ["run", *(pytest.param(x, marks=pytest.mark.slow) for x in FUNCTIONS if x != "run")]
)
def test_a_tracker_may_be_passed_in_or_closed_over(function):
    made, frames = partitioned(1.0), jnp.asarray(GAPS)
    jax.eval_shape(lambda its, key: FUNCTIONS[function](its, key, frames), made, KEY)
    jax.eval_shape(lambda key: FUNCTIONS[function](made, key, frames), KEY)


@pytest.mark.slow
def test_frames_that_are_closed_over_give_what_a_run_outside_gives():
    made, frames = partitioned(1.0), jnp.asarray(GAPS)
    inside = jax.jit(lambda its, key: jaxpf.run(its, key, frames, final)[1])(made, KEY)
    np.testing.assert_allclose(inside, jaxpf.run(made, KEY, GAPS, final)[1], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    "function",
    ["run", *(pytest.param(f, marks=pytest.mark.slow) for f in ("monte_carlo", "log_evidence"))],
)
@pytest.mark.parametrize(
    "switch",
    [
        pytest.param(lambda: jax.enable_x64(True), id="64 bits"),
        pytest.param(lambda: jax.debug_nans(True), id="checks for NaN", marks=pytest.mark.slow),
        pytest.param(jax.disable_jit, id="no jit", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("source", ["NumPy", pytest.param("JAX", marks=pytest.mark.slow)])
def test_functions_work_under_the_switches_of_jax(switch, function, source):
    # An objective has no missing frames, and JAX itself refuses its own arrays with NaN.
    frames = GAPS if source == "NumPy" and function != "log_evidence" else FRAMES
    with switch():
        given = frames if source == "NumPy" else jnp.asarray(frames)
        made = partitioned(np.float32(1.0))
        assert jnp.isfinite(total(FUNCTIONS[function](made, KEY, given)))


def exchanging(scale):
    its = partitioned(scale)
    return dataclasses.replace(its, ordering=ordering.sps(num_partitions=2))


@pytest.mark.parametrize(
    ("name", "function"),
    [
        ("partitioned", "run"),
        *(
            pytest.param(*other, marks=pytest.mark.slow)
            for other in (
                ("labelled", "run"),
                ("pffl", "run"),
                ("eskil", "run"),
                ("error-bars", "run"),
                ("side-by-side", "run"),
                ("exchanging", "run"),
                ("partitioned", "smooth"),
                ("partitioned", "monte_carlo"),
            )
        ),
    ],
)
def test_no_key_is_used_twice(name, function):
    """All tests run so with ``JAX_DEBUG_KEY_REUSE=1``, but for chains, which keep their keys."""
    with jax.debug_key_reuse(True):
        make = TRACKERS.get(name, exchanging)
        assert jnp.isfinite(total(FUNCTIONS[function](make(np.float32(1)), KEY, FRAMES)))
