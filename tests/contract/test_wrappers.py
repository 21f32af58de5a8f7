"""Every optional method and attribute of a likelihood, through every wrapper."""

import dataclasses
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import contract, ordering, pytree_dataclass
from jaxpf.contract import calls
from jaxpf.contract.calls import DEFAULTS, likelihood_of, optional
from jaxpf.detections.population import Detected
from jaxpf.dynamics import RandomWalk, WithOcclusion
from jaxpf.filters import SideBySide, WithErrorBars
from jaxpf.papers.smith2004.scenes import OtherEnding
from jaxpf.parts.models import OfFixedSize
from jaxpf.running.missing_frames import (
    LikelihoodOfNoFrame,
    LikelihoodWithGaps,
    WithGaps,
    WithoutFrames,
)
from jaxpf.tuning.problem import Observed

P = 2
KEY = jax.random.key(0)
FRAME = jnp.array([[1.0, 2.0], [3.0, 4.0]])
PARTITION = jnp.array([1, 0])
LOG_PROBS, LABEL = jnp.array([0.5, 0.25]), jnp.array(1)
#: (x, y, theta) of two parts, [D, P], and the same as (u, v, scale, theta).
POSES = jnp.array([[1.0, 5.0], [2.0, 6.0], [0.1, 0.2]])
BOXES = jnp.array([[1.0, 5.0], [2.0, 6.0], [1.0, 1.0], [0.1, 0.2]])


def total(substates, axis):
    """A different number for other coordinates, or for those of another axis."""
    weights = jnp.array([1.0, 10.0, 100.0, 1000.0])
    return jnp.tensordot(weights, substates, axes=(0, axis))


@pytree_dataclass
class Everything:
    """All that a likelihood may offer, of (u, v, scale, theta)."""

    shift: float = 0.0

    state_gradient = False
    fixed_observation = True
    model_error = (1.0, 2.0, 3.0)
    handles_nan = True
    form = "density"
    orders_of_labels = ((0, 1), (1, 0))
    space = "a space"

    def observe(self, frame):
        return jnp.sum(2 * frame)

    def log_prob_all(self, observation, partition, substates):
        return observation + partition + total(substates, 0) + self.shift

    def log_joint(self, observation, substates, log_probs, observed=True):
        return observation + jnp.sum(jnp.where(observed, total(substates, 1) + log_probs, 0))

    def log_joint_labelled(self, observation, substates, log_probs, label, observed=True):
        return self.log_joint(observation, substates, log_probs, observed) + label

    def log_joint_all(self, observation, substates, log_probs, observed=True):
        seen = jnp.broadcast_to(observed, P)[:, None]
        return observation + jnp.sum(jnp.where(seen, total(substates, 1) + log_probs, 0), axis=0)

    def log_joint_labelled_all(self, observation, substates, log_probs, label, observed=True):
        return self.log_joint_all(observation, substates, log_probs, observed) + label

    def log_first_stage(self, observation, substates):
        return observation + jnp.sum(total(substates, 1))

    def log_odds(self, observation, partition, substate):
        return observation + partition + total(substate, 0)

    def log_odds_all(self, observation, partition, substates):
        return observation + partition + total(substates, 0)

    def reaches_border(self, partition, substates):
        return total(substates, 0) > 200 + partition

    def same_place(self, partition, substates):
        return jnp.subtract.outer(*[total(substates, 0) + partition] * 2)

    def look_near(self, observation, estimates):
        return observation + total(estimates, 1)

    def observe_nearby(self, frame, estimates):
        return self.observe(frame) + total(estimates, 1)

    def sample(self, key, substates):
        return total(substates, 1) + jax.random.normal(key)

    def at_frame(self, time):
        return dataclasses.replace(self, shift=3.0 * time)

    def with_inputs(self, inputs, first):
        return dataclasses.replace(self, shift=inputs + first)


ATTRIBUTES = (
    "fixed_observation", "form", "handles_nan", "model_error", "orders_of_labels",
    "space", "state_gradient",
)  # fmt: skip
#: Arguments of the methods, given what is seen of a frame and substates [D, P].
OF_OBSERVATIONS = {
    "log_first_stage": lambda seen, x: (seen, x.T),
    "log_joint": lambda seen, x: (seen, x.T, LOG_PROBS),
    "log_joint_all": lambda seen, x: (seen, x.T[..., None], LOG_PROBS[:, None]),
    "log_joint_labelled": lambda seen, x: (seen, x.T, LOG_PROBS, LABEL),
    "log_joint_labelled_all": lambda seen, x: (
        seen, x.T[..., None], LOG_PROBS[:, None], LABEL[None]
    ),
    "log_odds": lambda seen, x: (seen, PARTITION[0], x[:, 0]),
    "log_odds_all": lambda seen, x: (seen, PARTITION, x),
    "look_near": lambda seen, x: (seen, x.T),
}  # fmt: skip
OF_FRAMES = {"observe_nearby": lambda frame, x: (frame, x.T)}
OF_STATES = {
    "at_frame": lambda _, x: (7,),
    "reaches_border": lambda _, x: (PARTITION, x),
    "same_place": lambda _, x: (PARTITION, x),
    "sample": lambda _, x: (KEY, x.T),
    "with_inputs": lambda _, x: (5.0, 2),
}
METHODS = OF_OBSERVATIONS | OF_FRAMES | OF_STATES


def detected(likelihood, dimension=4):
    """Objects of which none is detected."""
    return Detected(likelihood, jnp.full((P, dimension), jnp.nan), jnp.ones((P, dimension)))


#: Each wrapper, its frame, and its substates, which are BOXES for the likelihood inside.
WRAPPERS = {
    "fixed size": (OfFixedSize, FRAME, POSES),
    "detected": (detected, FRAME, BOXES),
    "detected parts": (lambda x: detected(OfFixedSize(x), 3), FRAME, POSES),
    "gaps": (LikelihoodWithGaps, (FRAME, jnp.array(True)), BOXES),
    "gaps of parts": (
        lambda x: LikelihoodWithGaps(OfFixedSize(x)), (FRAME, jnp.ones(P, bool)), POSES
    ),
    "no frame": (LikelihoodOfNoFrame, (FRAME, jnp.array(False)), BOXES),
}  # fmt: skip


def result(likelihood, name, frame, substates):
    seen = frame if name in OF_FRAMES else likelihood.observe(frame)
    value = getattr(likelihood, name)(*METHODS[name](seen, substates))
    if name in ("at_frame", "with_inputs"):
        assert type(value) is type(likelihood)
        return value.log_prob_all(value.observe(frame), PARTITION, substates)
    is_pair = isinstance(value, tuple) and len(value) == 2
    return value[0] if is_pair else value


@pytest.mark.parametrize("wrapper", WRAPPERS)
@pytest.mark.parametrize("name", METHODS)
def test_a_wrapper_calls_the_method_inside_with_what_that_understands(name, wrapper):
    wrap, frame, substates = WRAPPERS[wrapper]
    expected = result(Everything(), name, FRAME, BOXES)
    if wrapper == "no frame" and name not in ("reaches_border", "same_place", "sample"):
        expected = () if name in ("look_near", "observe_nearby") else jnp.zeros_like(expected)
    actual = result(wrap(Everything()), name, frame, substates)
    np.testing.assert_allclose(actual, expected, rtol=1e-6)


@pytest.mark.parametrize("name", OF_OBSERVATIONS)
def test_what_was_not_seen_counts_nothing(name):
    gaps = LikelihoodWithGaps(Everything())
    missing = result(gaps, name, (FRAME, jnp.array(False)), BOXES)
    np.testing.assert_array_equal(missing, jnp.zeros_like(missing))
    seen = jnp.array([True, False])
    partly = result(gaps, name, (FRAME, seen), BOXES)
    if name.startswith("log_joint"):
        arguments = METHODS[name](Everything().observe(FRAME), BOXES)
        expected = getattr(Everything(), name)(*arguments, observed=seen)
    else:
        whole = result(Everything(), name, FRAME, BOXES)
        by_partition = jnp.where(seen[PARTITION], whole, 0)
        expected = {
            "log_first_stage": 0.0,
            "log_odds": by_partition[0],
            "log_odds_all": by_partition,
            "look_near": whole,
        }[name]
    np.testing.assert_allclose(partly, expected, rtol=1e-6)


@pytest.mark.parametrize("wrapper", WRAPPERS)
def test_a_wrapper_has_the_attributes_inside_and_no_method_more(wrapper):
    wrap, *_ = WRAPPERS[wrapper]
    for name in ATTRIBUTES:
        assert optional(wrap(Everything()), name) == getattr(Everything, name)
    plain = wrap(Plain())
    for name in (*ATTRIBUTES, *METHODS):
        assert optional(plain, name) == optional(Plain(), name)


@pytree_dataclass
class Plain(contract.Likelihood):
    """Offers nothing that is optional."""

    def log_prob(self, observation, partition, substate):
        return jnp.sum(observation) + jnp.sum(substate)


def test_the_documents_name_all_that_is_looked_up():
    parts = contract.Likelihood, contract.Tracker, contract.Dynamics, contract.Proposal
    documented = {name for part in parts for name in re.findall(r"``(\w+)", part.__doc__)}
    assert documented >= {*ATTRIBUTES, *METHODS, "as_seen"}
    elsewhere = {"coupled", "independent"}  # set by a class, a sampler
    assert documented >= DEFAULTS.keys() - elsewhere


TRACKERS = {
    "side by side": SideBySide,
    "error bars": WithErrorBars,
    "observed": Observed,
    "gaps": WithGaps,
    "no frames": WithoutFrames,
    "other ending": OtherEnding,
    "two": lambda x: WithGaps(SideBySide(x)),
}


@pytest.mark.parametrize("wrapper", TRACKERS)
def test_a_wrapped_tracker_has_the_model_inside(wrapper):
    tracker = jaxpf.Partitioned(
        dynamics=RandomWalk(1.0),
        likelihood=Everything(),
        ordering=ordering.sir(P),
        initial=jnp.zeros((P, 4)),
    )
    wrapped = TRACKERS[wrapper](tracker)
    assert wrapped.num_partitions == P
    assert likelihood_of(wrapped) is tracker.likelihood
    assert calls.handles_nan(wrapped)
    np.testing.assert_array_equal(calls.model_error(wrapped, P), [[1, 2, 3]] * P)
    names = [bias.cause for bias in contract.evidence_biases(wrapped)]
    assert names == [bias.cause for bias in contract.evidence_biases(tracker)]
    assert any("Everything" in name for name in names)  # it looks near the mean
    assert likelihood_of(calls.at_frame(wrapped, 7)).shift == 21
    assert likelihood_of(calls.with_inputs(wrapped, 5.0, 2)).shift == 7


@pytree_dataclass
class Varying(contract.Dynamics):
    """Moves by a step that depends on the frame and on an input."""

    step: float = 0.0

    def at_frame(self, time):
        return dataclasses.replace(self, step=self.step + time)

    def with_inputs(self, inputs, first):
        return dataclasses.replace(self, step=inputs)

    def propagate(self, key, partition, current, previous, parent):
        return current + self.step

    def predict(self, partition, current, previous):
        return current - self.step


def test_dynamics_with_labels_take_the_time_and_the_inputs_of_those_inside():
    labelled = WithOcclusion(Varying(), shapes=None)
    assert not calls.has_log_density(labelled)
    moving = labelled.with_inputs(0.5, 0).at_frame(2)
    moved = contract.propagate_all(moving, KEY, PARTITION, *[jnp.ones((3, 2))] * 3)
    np.testing.assert_array_equal(moved, 3.5 * jnp.ones((3, 2)))
    predicted = calls.predict_all(moving, PARTITION, *[jnp.ones((3, 2))] * 2)
    np.testing.assert_array_equal(predicted, -1.5 * jnp.ones((3, 2)))
