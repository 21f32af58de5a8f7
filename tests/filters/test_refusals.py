"""What the filters refuse, and what they name: one row for each rule."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from correlated import CorrelatedGaussian
from jax.scipy.stats import norm
from models import space, walks
from refusals import assert_names, every, message_of, outside
from unsuited_dynamics import Coupled

import jaxpf
from jaxpf import ordering
from jaxpf.contract.options import options_of
from jaxpf.dynamics import IndependentGaussian
from jaxpf.filters import SideBySide, WithErrorBars, quantiles
from jaxpf.gradients import Soft, Transport
from jaxpf.likelihoods import Gaussian
from jaxpf.proposals import LocallyOptimal

KEY, P = jax.random.key(0), 3
START = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 20.0]])
MODEL = walks(P, 2) | {"initial": START}
TREE, EXCHANGE = (-1, 0, 0), ordering.sps(num_partitions=P)
CORRELATED = CorrelatedGaussian(np.eye(P))
SPEED = {"feedback": "estimate"}


#: In an order that suits a tree.
JOINT = {"order": ordering.ps([0, 1, 2]), "likelihood": CORRELATED}
HALVES = np.array([0.5, 0.5])


@jaxpf.pytree_dataclass
class OfLabels(Gaussian):
    """By a label, which there must be."""

    def log_joint_labelled(self, observation, substates, log_probs, label):
        return jnp.sum(log_probs)


@jaxpf.pytree_dataclass
class Flipping(jaxpf.dynamics.RandomWalk):
    """Labels that flip by a chance that is not known."""

    def propagate_label(self, key, label, substates):
        return 1 - label


OF_LABELS = OfLabels(MODEL["likelihood"].noise)
UNKNOWN_LAW = {"dynamics": Flipping(1.0), "motion_gradient": "score", "order": JOINT["order"]}


@jax.tree_util.Partial
def sampler(key):
    return jax.random.normal(key, (P, 2))


DPS = ordering.dps(P)


def partitioned(order=DPS, **changes):
    return jaxpf.Partitioned(ordering=order, **MODEL | changes)


def labelled(**changes):
    return jaxpf.Labelled(**MODEL | changes)


def population(**changes):
    empty = np.full((P, 2), np.nan, np.float32)
    return labelled(initial=empty, population="open", **changes)


def eskil(**changes):
    return jaxpf.Eskil(**MODEL | changes)


def pffl(**changes):
    return jaxpf.PFFL(**MODEL | changes)


def bars(lag=3, **changes):
    return WithErrorBars(partitioned(ordering.ps([1, 0, 2]), **changes), lag=lag)


def outside_declared(tracker):
    """Name of each field with a declared range: values outside of it."""
    for name, about in options_of(tracker).items():
        ends = about.least - 1, about.above, about.most + 1
        yield name, ["nonsense"] if about.choices else [x for x in ends if np.isfinite(x)]


@outside({
    make: dict(outside_declared(type(make()))) for make in (partitioned, labelled, eskil, pffl)
})  # fmt: skip
def test_a_field_outside_the_range_of_its_option_is_named(make, argument, value):
    assert_names(make, argument, value)


#: The noise of a motion by known inputs cannot be checked before they are given.
PUSHED = {
    "transition": lambda key, x, p, u: x + u + jax.random.normal(key),
    "transition_log_density": lambda new, x, p, u: norm.logpdf(new, x + u),
    "motion_gradient": "score",
}


def by_sign(y, x, p):
    return -1.0 if x < 0 else -(y**2)


def tree(**changes):
    """A state of an integer and a float."""
    model = {
        "initial": lambda key, p: {"regime": jnp.int32(0), "level": jnp.float32(0)},
        "transition": lambda key, x, p: x | {"level": x["level"] + jax.random.normal(key)},
        "log_likelihood": lambda y, x, p: norm.logpdf(y, x["level"]),
    }
    return space(**model | changes)


@every([
    (lambda: ordering.sir(0), "num_partitions = 0"),
    (lambda: ordering.sir(10**12), "10000"),
    (lambda: ordering.ps([0, 0, 1]), "[0, 0, 1]"),
    (lambda: ordering.dps(), "num_partitions = None"),
    (lambda: ordering.dps(orders=[[0, 1, 2], [0, 1]]), "component 1"),
    (lambda: ordering.dps(3, reassembly="sum"), "reassembly='sum'"),
    (lambda: ordering.branched([[0, 1], [1, 1]]), "order [1, 1] of component 1"),
    (lambda: ordering.sps(), "num_partitions = None"),
    (lambda: ordering.sps([]), "parents is empty"),
    (lambda: ordering.sps([-1, 0], "best"), "swap='best'"),
    (lambda: ordering.sps([-1, 5]), "parents[1]=5"),
    (lambda: ordering.sps([-1, 2, 1]), "cycle, 1 on 2 on 1"),
    (lambda: ordering.sps([0]), "cycle, 0 on 0"),
    (lambda: partitioned(parents=(-1, 0)), "parents has 2 parts"),
    (lambda: partitioned(parents=(-1, 0, 7)), "parents[2]=7"),
    (lambda: partitioned(initial=np.zeros(3)), "initial has shape [3]"),
    (lambda: partitioned(num_particles=2), "num_particles=2"),
    (lambda: partitioned(parents=TREE), "part 1 before its parent 0"),
    (lambda: partitioned(EXCHANGE, likelihood=CORRELATED), "log_joint"),
    (lambda: partitioned(ordering.sps([-1] * P, "sorted"), tempering=0.5), "tempering=0.5"),
    (lambda: partitioned(ordering.sps(TREE), parents=(-1, 0, 1)), "[-1, 0, 1]"),
    (lambda: partitioned(EXCHANGE, initial=sampler), "initial sampler"),
    (lambda: partitioned(gradient=Soft(share=1.5)), "share=1.5"),
    (lambda: partitioned(motion_gradient="both"), "motion_gradient='both'"),
    (lambda: partitioned(EXCHANGE, gradient=Transport()), "gradient Transport"),
    (lambda: partitioned(dynamics=Coupled(), proposal=LocallyOptimal()), "Coupled"),
    (lambda: partitioned(gradient=Transport(), tempering=0.5), "tempering"),
    (lambda: partitioned(gradient=Transport(), likelihood=CORRELATED), "log_joint"),
    (lambda: partitioned(ordering.branched([[0, 1, 2]]), gradient=Transport()), "components"),
    (lambda: partitioned(gradient=Transport(epsilon=0.0)), "epsilon=0.0"),
    (lambda: partitioned(joint_weighting=True, **JOINT, parents=TREE), "part tree"),
    (lambda: partitioned(joint_weighting=True, **JOINT, gradient=Soft()), "gradient"),
    *((lambda label=label: partitioned(likelihood=OF_LABELS, initial_label=label), "label")
      for label in (None, np.array([0.5, 0.6]), np.array([-0.5, 1.5]), np.array(0.5))),
    (lambda: partitioned(ordering.branched([[0, 1, 2]]), initial_label=HALVES), "1 branches"),
    (lambda: partitioned(initial_label=HALVES, **UNKNOWN_LAW), "Flipping has none"),
    (lambda: bars(lag=-1), "lag = -1"),
    (lambda: bars(gradient=Transport()), "gradient Transport"),
    (lambda: SideBySide(partitioned(), 1), "num_runs = 1"),
    *((lambda levels=levels: quantiles(np.ones((3, 1, 1)), np.zeros(3), levels), "from 0 to 1")
      for levels in ([0.5, 1.5], [np.nan])),
])  # fmt: skip
def test_what_a_partitioned_filter_cannot_do_is_refused(call, named):
    assert named in message_of(call)


def test_what_is_refused_with_an_exchange_is_fine_without():
    alone = ordering.sps(num_partitions=P, swap="none")
    partitioned(alone, likelihood=CORRELATED)
    partitioned(alone, tempering=0.5)
    partitioned(ordering.sps(num_partitions=P, exchange_roots=False), initial=sampler)
    partitioned(ordering.sps(TREE), parents=TREE, initial=sampler)


@every([
    (lambda: labelled(num_particles=2), "3 targets"),
    (lambda: labelled(gradient=Soft()), "StopGradient"),
    (lambda: labelled(gradient=Transport()), "StopGradient"),
    (lambda: labelled(initial=np.zeros(3)), "initial has shape [3]"),
    (lambda: labelled(regularise=(0.0, 1.0)), "regularise=(0.0, 1.0)"),
    (lambda: labelled(speed=(2, 3), **SPEED), "speed=[2, 3]"),
    (lambda: labelled(speed=(1,), **SPEED), "speed"),
    (lambda: labelled(speed=(0, 1), **SPEED), "different coordinates"),
    (lambda: labelled(motion_gradient="score", **SPEED), "motion_gradient='score'"),
    (lambda: population(weights="plain"), "weights='plain'"),
    (lambda: population(num_particles=2), "3 targets"),
    (lambda: labelled(population="open", initial=IndependentGaussian(START, 1.0)), "initial"),
    (lambda: eskil(initial=START[:1]), "two partitions"),
    (lambda: eskil(initial=0 * START), "same place"),
    (lambda: eskil(initial=START[0]), "initial has shape"),
    (lambda: eskil(initial=START * np.nan), "not finite"),
    (lambda: eskil(reference=1e30 * np.eye(3)[:, :2]), "too far apart"),
    (lambda: eskil(reference=START * np.nan), "reference"),
    (lambda: eskil(likelihood=CORRELATED), "all objects together"),
    (lambda: pffl(safety=0.0), "safety=0.0"),
])  # fmt: skip
def test_what_labelled_and_factored_filters_cannot_do_is_refused(call, named):
    assert named in message_of(call)


@every([
    (lambda: space(**PUSHED), "row time"),
    (lambda: jaxpf.smooth(space(), KEY, np.zeros(4)), "transition_log_density"),
    (lambda: tree(num_values={"level": 3}), "num_values={'level': 3}"),
    (lambda: tree(num_values=0), "num_values = 0"),
    (lambda: tree(gradient=Transport()), "integers"),
])  # fmt: skip
def test_wrong_functions_are_refused(call, named):
    assert named in message_of(call)


@pytest.mark.parametrize(
    ("changes", "note"),
    [
        ({"log_likelihood": by_sign}, "In log_likelihood (by_sign) of jaxpf.state_space"),
        ({"transition": lambda key, x, p: x + p["no"]}, "In transition (<lambda>)"),
        ({"transition": lambda key, x: x}, "given (key, x, parameters), and may take previous"),
        ({"transition": lambda key, x, p, u: x + u}, "if they are given inputs="),
    ],
)
def test_a_note_says_in_which_function_an_exception_is_raised(changes, note):
    with pytest.raises((TypeError, KeyError)) as raised:
        jaxpf.run(space(**changes), KEY, np.zeros(4))
    assert note in "".join(raised.value.__notes__)


def test_a_note_says_in_which_model_shapes_do_not_fit():
    tracker = partitioned(dynamics=jaxpf.dynamics.RandomWalk(np.ones(4)))  # of two coordinates
    with pytest.raises((TypeError, ValueError)) as raised:
        jaxpf.run(tracker, KEY, np.zeros((4, P, 2)))
    assert "Partitioned (dynamics" in "".join(raised.value.__notes__)
