"""What an ordering must be refused for is refused, or NaN where the ordering is traced."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from correlated import CorrelatedGaussian
from unsuited_dynamics import Coupled

import jaxpf
from jaxpf import InputError, Summary, ordering, pytree_dataclass, smoothing
from jaxpf.contract.state import STATUS_UNSUPPORTED
from jaxpf.dynamics import LinearGaussian
from jaxpf.likelihoods import Gaussian
from jaxpf.smoothing import gibbs
from jaxpf.smoothing.checks import check_smoothing

FRAMES = np.random.default_rng(0).normal(size=(2, 3, 1)).astype(np.float32)
KEY = jax.random.key(1)
ONES = np.ones((3, 1, 1), np.float32)
TREE = (-1, 0, 0)
PS, DPS, FLAT = ordering.ps([0, 1, 2]), ordering.dps(3), ordering.sps(num_partitions=3)


@pytree_dataclass
class Walk(LinearGaussian):
    """A walk whose labels follow the first object."""

    def propagate_label(self, key, label, substates):
        return (substates[0, 0] > 0).astype(int)


@jax.tree_util.Partial
def joint_start(key):
    return jnp.zeros((3, 1)) + jax.random.normal(key)


def tracker(order, dynamics=LinearGaussian, **changes):
    has_parts = "parents" in changes
    settings = {
        "dynamics": dynamics(0.9 * ONES, ONES, coupling=0.5 * ONES if has_parts else None),
        "likelihood": Gaussian(ONES),
        "ordering": order,
        "initial": np.zeros((3, 1), np.float32),
        "num_particles": 9,
        "resampling": "multinomial",
    }
    return jaxpf.Partitioned(**settings | changes)


def run(made):
    is_joint = hasattr(getattr(made, "likelihood", None), "log_joint")
    return jaxpf.run(made, KEY, FRAMES[..., 0] if is_joint else FRAMES)


def built(**changes):
    """A tracker is built with the argument, and run; and its condition alone."""
    return lambda order: run(
        tracker(order, **changes)
    ), lambda order: tracker(order, **changes).refused


SMOOTHING = lambda made: jaxpf.smooth(made, KEY, FRAMES, 3), check_smoothing
GIBBS = lambda made: smoothing.particle_gibbs(made, KEY, FRAMES, 2), gibbs.check_conditional


def of(*orders):
    """Trackers that are arguments themselves, and were checked when they were built."""
    return [tracker(order) for order in orders]


def forest(**settings):
    parents = (-1, -1, 0)
    return tracker(ordering.sps(parents, **settings), parents=parents)


#: Name: what is used, what of it is refused, arguments that work, and others.
CASES = {
    "orders and trees": (
        built(parents=TREE),
        [PS, ordering.sps(TREE)],
        [ordering.ps([1, 0, 2]), DPS, ordering.sps([-1, -1, 0])],
    ),
    "joint likelihood": (
        built(likelihood=CorrelatedGaussian(np.eye(3, dtype=np.float32))), [PS], [FLAT],
    ),
    "tempering": (built(tempering=0.5), [DPS], [FLAT]),
    "moving labels": (built(dynamics=Walk, initial_label=np.array([0.5, 0.5])), [PS], [FLAT]),
    "joint start": (
        built(initial=joint_start),
        [PS, ordering.sps(num_partitions=3, exchange_roots=False)],
        [FLAT],
    ),
    "coupled": (built(dynamics=lambda *_, **__: Coupled()), [PS], [FLAT]),
    "few particles": (built(num_particles=2), [PS], [DPS]),
    "few branches": (
        built(initial_label=np.ones(3) / 3),
        [ordering.branched([[0, 1, 2], [2, 0, 1], [1, 0, 2]])],
        [ordering.branched([[0, 1, 2], [2, 0, 1]])],
    ),
    "particle Gibbs": (GIBBS, of(PS, ordering.sir(3)), of(DPS, FLAT)),
    "smoothing": (SMOOTHING, of(PS, FLAT), of(ordering.sps([-1] * 3, "sorted"))),
    "smoothing a forest": (
        SMOOTHING,
        [forest(exchange_roots=False)],
        [forest(exchange_roots=True)],
    ),
}  # fmt: skip


def signs(result):
    """Of every array of floats, whether it is NaN, and of every frame, whether it says why."""
    floats = [x for x in jax.tree.leaves(result) if jnp.issubdtype(x.dtype, jnp.floating)]
    summaries = jax.tree.leaves(result, is_leaf=lambda x: isinstance(x, Summary))
    marks = [x.status & STATUS_UNSUPPORTED for x in summaries if isinstance(x, Summary)]
    return [np.isnan(x).all() for x in floats] + [bool(x) for mark in marks for x in np.ravel(mark)]


def one_by_one(use):
    compiled = jax.jit(lambda given: use(given))  # programs of its own, whatever else used ``use``

    def results(given):
        found = [compiled(each) for each in given]
        assert compiled._cache_size() == 1  # another ordering does not recompile
        return found

    return results


def stacked(transformed):
    def of_use(use):
        def results(given):
            stack = jax.tree.map(lambda *x: jnp.stack(x), *given)
            found = jax.jit(transformed(use))(stack)
            return [
                jax.tree.map(lambda x, place=place: x[place], found) for place in range(len(given))
            ]

        return results

    return of_use


ALWAYS = "scan", "orders and trees"
TRANSFORMS = {
    "jit": one_by_one,
    "scan": stacked(lambda use: lambda stack: jax.lax.map(use, stack)),
    "vmap": stacked(jax.vmap),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_refused_outside_is_known_inside(name):
    (use, condition), fine, wrong = CASES[name]
    for each in wrong:
        with pytest.raises(InputError):
            jax.eval_shape(lambda use=use, each=each: use(each))
    assert all(condition(each) is None for each in fine)
    expected = [False] * len(fine) + [True] * len(wrong)
    assert TRANSFORMS["scan"](condition)([*fine, *wrong]) == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("transform", "name"),
    [
        pytest.param(transform, name, marks=[pytest.mark.always] * ((transform, name) == ALWAYS))
        for transform in TRANSFORMS
        for name in CASES
    ],
)
def test_what_is_refused_outside_is_no_number_inside(name, transform):
    (use, _), fine, wrong = CASES[name]
    found = TRANSFORMS[transform](use)([*fine, *wrong])
    assert not any(any(signs(each)) for each in found[: len(fine)])
    assert all(all(signs(each)) for each in found[len(fine) :])
