"""What the filters refuse, and what they name: one row for each rule."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from correlated import CorrelatedGaussian
from jax.scipy.stats import norm
from refusals import assert_names, every, message_of, outside
from unsuited_dynamics import Blind

import jaxpf
from jaxpf import ordering
from jaxpf.contract.options import options_of
from jaxpf.dynamics import IndependentGaussian, RandomWalk
from jaxpf.filters import SideBySide, WithErrorBars, add_target, quantiles, remove_target
from jaxpf.filters.factored.options import Options as FactoredOptions
from jaxpf.filters.labelled.options import Options as LabelledOptions
from jaxpf.filters.partitioned.options import Options as PartitionedOptions
from jaxpf.gradients import Soft, Transport
from jaxpf.likelihoods import Gaussian

KEY, P = jax.random.key(0), 3
START = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 20.0]])
MODEL = {
    "dynamics": RandomWalk(1.0),
    "likelihood": Gaussian(np.tile(np.eye(2), (P, 1, 1))),
    "initial": START,
}
TREE, EXCHANGE, CORRELATED = (
    (-1, 0, 0),
    ordering.sps(num_partitions=P),
    CorrelatedGaussian(np.eye(P)),
)
SPEED = {"feedback": "estimate"}


@jax.tree_util.Partial
def sampler(key):
    return jax.random.normal(key, (P, 2))


DPS = ordering.dps(P)


def partitioned(order=DPS, **changes):
    return jaxpf.Partitioned(ordering=order, **MODEL | changes)


def labelled(**changes):
    return jaxpf.Labelled(**MODEL | {"num_targets": P} | changes)


def population(**changes):
    empty = np.full((P, 2), np.nan, np.float32)
    return labelled(initial=empty, population="open", num_targets=None, **changes)


def eskil(**changes):
    return jaxpf.Eskil(**MODEL | changes)


def pffl(**changes):
    return jaxpf.PFFL(**MODEL | changes)


def bars(lag=3, **changes):
    return WithErrorBars(partitioned(ordering.ps([1, 0, 2]), **changes), lag=lag)


#: Fields of trackers whose options have another name.
RENAMED = {"memory": "velocity_memory"}


def outside_declared(options, fields):
    """Name of each field that is declared as an option: values outside of its range."""
    for field in fields:
        about = options_of(options).get(RENAMED.get(field.name, field.name))
        if about is None or about.length or about.kind is bool:
            continue
        ends = () if about.choices else (about.least - 1, about.above, about.most + 1, [1, 2])
        yield field.name, ["nonsense", *(x for x in ends if np.isfinite(x).all())]


@outside({
    make: dict(outside_declared(options, dataclasses.fields(make())))
    for make, options in (
        (partitioned, PartitionedOptions), (labelled, LabelledOptions),
        (eskil, FactoredOptions), (pffl, FactoredOptions),
    )
})  # fmt: skip
def test_a_field_outside_the_range_of_its_option_is_named(make, argument, value):
    assert_names(make, argument, value)


def move(key, x, p):
    return p["a"] * x + jax.random.normal(key)


def space(**changes):
    model = {
        "initial": lambda key, p: jax.random.normal(key),
        "transition": move,
        "log_likelihood": lambda y, x, p: norm.logpdf(y, x),
        "parameters": {"a": 0.9},
    }
    return jaxpf.state_space(**model | changes)


#: The noise of a motion by known inputs cannot be checked before they are given.
PUSHED = {
    "transition": lambda key, x, p, u: x + u + jax.random.normal(key),
    "transition_log_density": lambda new, x, p, u: norm.logpdf(new, x + u),
    "motion_gradient": "score",
}


def run(tracker, **options):
    return jaxpf.run(tracker, KEY, np.zeros(4), **options)


def with_numpy(key, x, p):
    return np.sin(x) + jax.random.normal(key)


def drawn_by_numpy(key, x, p):
    return x + np.random.normal()  # noqa: NPY002


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
    (lambda: ordering.sir(0), "num_partitions = 0 must be a whole number from 1"),
    (lambda: ordering.sir(10**12), "1000000000000 must be a whole number from 1 to 10000"),
    (lambda: ordering.dps(-2), "num_partitions = -2"),
    (lambda: ordering.sps(num_partitions=0), "num_partitions = 0"),
    *((lambda count=count: ordering.sir(count), f"{count!r} must be a whole number")
      for count in ("2", 2.5, True)),
    *((lambda order=order: ordering.ps(order), "is not a list of whole numbers")
      for order in ("10", [0.5, 1], 3, None, ["1", "0"])),
    (lambda: ordering.ps([0, 0, 1]), "[0, 0, 1] of component 0 is not a permutation of 0..2"),
    (lambda: ordering.named("ps", [-1, -1], order=3), "order 3 is not a list of whole numbers"),
    (lambda: ordering.dps(), "dps() needs a number of partitions or a list of orders"),
    (lambda: ordering.dps(orders=[]), "orders is empty"),
    (lambda: ordering.dps(orders=3), "orders=3 must be a list of orders"),
    (lambda: ordering.dps(3, orders=[[0, 1]]), "orders=[[0, 1]] do not all hold the 3"),
    (lambda: ordering.dps(orders=[[0, 1, 2], [0, 1]]), "order [0, 1] of component 1"),
    (lambda: ordering.dps(3, reassembly="sum"), "reassembly='sum' is unknown; choose one of evid"),
    (lambda: ordering.branched([]), "orders is empty"),
    (lambda: ordering.branched([[0, 1], [1, 1]]), "order [1, 1] of component 1"),
    (lambda: ordering.sps(), "sps() needs the part tree `parents` or a number"),
    (lambda: ordering.sps([]), "parents is empty"),
    (lambda: ordering.sps([-1, 0], "best"), "swap='best' is unknown"),
    (lambda: ordering.sps([-1, 5]), "parents[1]=5 is not a part; use 0..1"),
    (lambda: ordering.sps([-2, 0]), "parents[0]=-2 is not a part"),
    (lambda: ordering.sps([1, 0, None]), "parents [1, 0, None] is not a list of whole numbers"),
    (lambda: ordering.sps([-1, 2, 1]), "parents=[-1, 2, 1] form a cycle, 1 on 2 on 1"),
    (lambda: ordering.sps([0]), "parents=[0] form a cycle, 0 on 0"),
])  # fmt: skip
def test_a_wrong_ordering_is_refused(call, named):
    assert named in message_of(call)


@every([
    (lambda: partitioned([0, 1, 2]), "ordering=[0, 1, 2] is not an ordering; make one by"),
    (lambda: partitioned(parents=(-1, 0)), "parents has 2 parts"),
    (lambda: partitioned(parents=(-1, 0, 7)), "parents[2]=7 is not a part"),
    (lambda: partitioned(initial=np.zeros(3)), "initial has shape [3]; give [3, D]"),
    (lambda: partitioned(initial=np.zeros((2, 1))), "initial has shape [2, 1]"),
    (lambda: partitioned(num_particles=2), "num_particles=2 is fewer than the 3"),
    (lambda: partitioned(parents=TREE), "order [1, 2, 0] puts part 1 before its parent 0"),
    (lambda: partitioned(EXCHANGE, likelihood=CORRELATED), "log_joint"),
    (lambda: partitioned(ordering.sps([-1] * P, "sorted"), tempering=0.5), "tempering=0.5"),
    (lambda: partitioned(ordering.sps(TREE), parents=(-1, 0, 1)), "unlike the model's [-1, 0, 1]"),
    (lambda: partitioned(EXCHANGE, initial=sampler), "exchanges roots, but the initial sampler"),
    (lambda: partitioned(initial_label=[[1], []]), "must be the probability"),
    (lambda: partitioned(gradient="exact"), "gradient='exact' is not a strategy"),
    (lambda: partitioned(gradient=Soft(share=1.5)), "Soft's share=1.5"),
    (lambda: partitioned(motion_gradient="both"), "motion_gradient='both' is unknown"),
    (lambda: partitioned(motion_gradient="score", dynamics=Blind()), "log_density of the dynamics"),
    (lambda: partitioned(EXCHANGE, gradient=Transport()), "needs lineages, and gradient Transport"),
    (lambda: partitioned(gradient=Transport(), tempering=0.5), "does not work with tempering"),
    (lambda: partitioned(gradient=Transport(), likelihood=CORRELATED), "that has log_joint"),
    (lambda: partitioned(ordering.branched([[0, 1, 2]]), gradient=Transport()), "components that"),
    (lambda: partitioned(gradient=Transport(epsilon=0.0)), "Transport's epsilon=0.0"),
    (lambda: bars(lag=-1), "lag = -1"),
    (lambda: bars(lag=1.5), "lag = 1.5 must be a whole number"),
    (lambda: bars(gradient=Transport()), "WithErrorBars does not work with gradient Transport"),
    (lambda: WithErrorBars(pffl()), "PFFL does not keep"),
    (lambda: SideBySide(partitioned(), 1), "num_runs = 1"),
    (lambda: SideBySide(3), "tracker is 3; give a tracker"),
    *((lambda levels=levels: quantiles(np.ones((3, 1, 1)), np.zeros(3), levels), "from 0 to 1")
      for levels in ([], 0.5, [0.5, 1.5], [-0.1], [np.nan])),
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
    (lambda: labelled(num_particles=2), "fewer than the 3 targets"),
    (lambda: labelled(gradient="soft"), "give NoGradient(), StopGradient()"),
    (lambda: labelled(gradient=Soft()), "use NoGradient() or StopGradient()"),
    (lambda: labelled(gradient=Transport()), "use NoGradient() or StopGradient()"),
    (lambda: labelled(initial=np.zeros(3)), "initial has shape [3]; give [3, D]"),
    (lambda: labelled(initial=sampler, num_targets=None), "num_targets=None"),
    (lambda: labelled(regularise=(0.0, 1.0)), "two rates above 0"),
    (lambda: labelled(regularise="fast"), "regularise='fast' must be two rates"),
    (lambda: labelled(position=3), "position=3 must be whole numbers"),
    (lambda: labelled(speed=(2, 3), **SPEED), "coordinates of a substate, counted from 0 to 1"),
    (lambda: labelled(speed=(1,), **SPEED), "one speed for each position"),
    (lambda: labelled(speed=(0, 1), **SPEED), "different coordinates"),
    (lambda: labelled(motion_gradient="score", **SPEED), "changes the move"),
    (lambda: labelled(population="closed"), "choose one of fixed, open"),
    (lambda: population(weights="plain"), "equal share"),
    (lambda: population(num_particles=2), "fewer than the 3 targets"),
    (lambda: labelled(population="open", initial=IndependentGaussian(START, 1.0)), "rows of NaN"),
    (lambda: add_target(labelled().init(KEY), 0, [0.0, 0.0]), "population='open'"),
    (lambda: remove_target(labelled().init(KEY), 0), "population='open'"),
    (lambda: eskil(initial=START[:1]), "two partitions or more"),
    (lambda: eskil(initial=0 * START), "start at the same place"),
    (lambda: eskil(initial=START[0]), "initial has shape"),
    (lambda: eskil(initial=START * np.nan), "not finite"),
    (lambda: eskil(reference="x"), "reference='x' must be finite positions"),
    (lambda: eskil(reference=1e30 * np.eye(3)[:, :2]), "too far apart"),
    (lambda: eskil(reference=START * np.nan), "must be finite positions"),
    (lambda: eskil(reference=START[:2]), "reference has shape [2, 2]; give finite"),
    (lambda: eskil(dynamics=Blind(), proper=True), "dynamics, and Blind has none"),
    (lambda: eskil(likelihood=CORRELATED), "weighs all objects together"),
    (lambda: pffl(safety=0.0), "safety=0.0 must be a finite number above 0 and at most 1"),
    (lambda: pffl(safety=None), "safety=None must be a finite"),
])  # fmt: skip
def test_what_labelled_and_factored_filters_cannot_do_is_refused(call, named):
    assert named in message_of(call)


def test_eskil_says_why_it_cannot_be_checked_for_nan():
    with jax.debug_nans(True):
        assert "NaN for the evidence" in message_of(jaxpf.run, eskil(), KEY, START[None])


@every([
    (lambda: space(transition=with_numpy), "transition (with_numpy) calls NumPy"),
    (lambda: space(transition=lambda key, x, p: float(x)), "float(x), int(x)"),
    (lambda: space(initial=lambda key, p: max(p["a"], 0)), "max; use jnp.where"),
    (lambda: space(initial=lambda key, p: p["a"], parameters=None), "initial reads parameters"),
    (lambda: space(**PUSHED), "read row time of an array in parameters"),
    (lambda: space(transition=drawn_by_numpy), "transition gives another result at every call"),
    (lambda: space(transition=lambda key, x: x), "transition takes (key, x), but must"),
    (lambda: space(transition=lambda key, x, p: jnp.ones(3)), "returns shape [3], and initial []"),
    (lambda: space(transition=0.9), "transition is 0.9, which is not a function"),
    (lambda: space(initial={}), "initial is a dict; give the state as one array, or a pytree"),
    (lambda: space(initial=None), "initial is a NoneType; give the state as one array"),
    (lambda: space(initial=[[1.0], [1.0, 2.0]]), "initial is list, not an array of numbers"),
    (lambda: space(parameters={"a": "no"}), "parameters['a'] is 'no'; give numbers and arrays"),
    (lambda: space(num_partices=3), "no option 'num_partices'; did you mean num_particles?"),
    (lambda: space(transition_logdensity=0), "did you mean transition_log_density?"),
    (lambda: space(transition=lambda x, key, p: x), "(x, key, p), but must take (key, x, para"),
    (lambda: space(log_likelihood=lambda x, y, p: y), "(x, y, p), but must take (y, x, parameters"),
    (lambda: space(transition_log_density=lambda new, x, p: x[None]), "density returns shape [1]"),
    (lambda: run(space(log_likelihood=by_sign)), "log_likelihood (by_sign) decides"),
    (lambda: run(space(log_likelihood=lambda y, x, p: None)), "log_likelihood returns nothing"),
    (lambda: run(space(log_likelihood=lambda y, x, p: 1j)), "log_likelihood returns complex"),
    (lambda: run(space(initial=jnp.zeros(2), transition=lambda key, x, p: x)),
     "log_likelihood returns shape [2]; return one number"),
    (lambda: jaxpf.smooth(space(), KEY, np.zeros(4)), "a transition_log_density"),
    (lambda: tree(transition=lambda key, x, p: x["level"]), "transition returns *, and initial {"),
    (lambda: tree(transition=lambda key, x, p: x | {"level": jnp.ones(2)}),
     "returns shape [2]['level'], and initial []"),
    (lambda: tree(num_values={"level": 3}), "num_values={'level': 3} is not for integers"),
    (lambda: tree(num_values=0), "num_values = 0 must be"),
    (lambda: tree(initial=lambda key, p: {}), "initial returns dict; return the state"),
    (lambda: run(tree(transition=lambda key, x, p, u: x | {"regime": x["regime"] + u}),
                 inputs=np.ones(4, np.float32)), "returns floats['regime'], and initial integers"),
])  # fmt: skip
def test_wrong_functions_are_refused(call, named):
    assert named in message_of(call)
