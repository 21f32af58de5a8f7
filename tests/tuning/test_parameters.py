"""Parameters by path, their bounds, and those that cannot be tuned."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import message_of
from small_tuning import QUICK, made_sequence, tracker

import jaxpf
from jaxpf import tune, tuning
from jaxpf.contract.options import options_of
from jaxpf.targets.registry import all_targets
from jaxpf.tuning.parameters import Parameter, names, parameter, read

# Paths and bounds


def test_parameters_are_named_by_their_path():
    assert names(tracker()) == ["dynamics.scale", "likelihood.noise", "initial"]
    one = read(tracker(scale=3.0), Parameter("dynamics.scale[0]", low=0.0))
    assert one == read(tracker(scale=3.0), parameter("dynamics.scale[0]=0:"))
    assert one.shape == ()
    assert one == 3.0
    changed = tuning.replace(tracker(), {"dynamics.scale[0]": 5.0, "likelihood.noise": [[[2.0]]]})
    assert changed.dynamics.scale[0] == 5.0
    assert changed.likelihood.noise[0, 0, 0] == 2.0
    assert changed.num_particles == 50


def test_a_python_number_is_a_parameter_too():
    walk = dataclasses.replace(tracker(), dynamics=jaxpf.dynamics.AR2(scale=jnp.ones(1)))
    assert "dynamics.momentum" in names(walk)
    assert tuning.replace(walk, {"dynamics.momentum": 0.25}).dynamics.momentum == 0.25


@pytest.mark.parametrize(
    ("low", "high"), [(-np.inf, np.inf), (0.0, np.inf), (-np.inf, 3.0), (0.5, 3.0), (-1, np.inf)]
)
def test_values_stay_within_their_bounds_whatever_the_free_numbers(low, high):
    with jax.enable_x64(True):
        one = Parameter("x", low, high)
        values = np.array([0.6, 1.0, 2.9])
        np.testing.assert_allclose(one.to_value(one.to_free(values)), values, rtol=1e-12)
        free = np.array([-30.0, -1.0, 0.0, 2.0, 30.0])
        inside = np.asarray(one.to_value(free))
        assert ((inside >= low) & (inside <= high)).all()
        step = 1e-6
        slope = (one.to_value(free[1:4] + step) - one.to_value(free[1:4] - step)) / 2 / step
        np.testing.assert_allclose(one.slope(free[1:4]), slope, rtol=1e-6)


def test_noise_and_sharpness_of_every_target_stay_positive_by_default():
    for target in all_targets().values():
        for option in options_of(target.tracker).values():
            assert not option.tuned or parameter(option.path).low == 0


def test_bounds_are_written_beside_the_path():
    assert parameter("likelihood.sharpness") == Parameter("likelihood.sharpness", 0.0)
    assert parameter("dynamics.scale[1]=0.5:9") == Parameter("dynamics.scale[1]", 0.5, 9.0)
    assert parameter("initial") == Parameter("initial")
    assert parameter("initial=:4").high == 4.0


@pytest.mark.parametrize(
    ("paths", "words"),
    [
        (["dynamics.speed"], "choose among dynamics.scale, li"),
        (["ordering.order"], "ordering.order"),
        (["dynamics.scale[1]"], "dynamics.scale"),
        (["dynamics.scale[a]"], "path"),
        (["dynamics.scale=2:5"], "between 2 and 5"),
        (["dynamics.scale=5:2"], "smaller"),
        (["dynamics.scale=5"], "PATH=LOW:HIGH"),
        (["dynamics.scale", "dynamics.scale[0]"], "overlap"),
        ([], "parameter"),
    ],
)
def test_a_parameter_that_cannot_be_tuned_is_refused_in_one_sentence(paths, words):
    assert words in message_of(tune, made_sequence(), paths, settings=QUICK)
