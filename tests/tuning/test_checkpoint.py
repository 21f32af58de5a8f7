"""Checkpoints: what another call, a missing package or a damaged file leads to."""

import dataclasses
import importlib.util

import pytest
from refusals import message_of
from small_tuning import QUICK, SCALE, made_sequence, tracker

import jaxpf
from jaxpf import InputError, gradients


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    folder = tmp_path_factory.mktemp("begun")
    jaxpf.tune(made_sequence(), SCALE, settings=QUICK, folder=folder)
    return folder


def other_frames():
    sequence = made_sequence()
    sequence.frames[3] += 1
    return sequence


@pytest.mark.parametrize(
    ("sequence", "named"),
    [
        (made_sequence(gradient=gradients.StopGradient()), "tracker"),
        (made_sequence(resampling="multinomial"), "tracker"),
        (dataclasses.replace(made_sequence(), tracker=tracker(noise=2.0)), "tracker"),
        (other_frames(), "frames"),
    ],
)
def test_what_differs_from_the_call_that_began_is_named(begun, sequence, named):
    message = message_of(jaxpf.tune, sequence, SCALE, settings=QUICK, folder=begun)
    assert f"another value of {named};" in message


def test_a_missing_package_is_told_before_there_is_a_checkpoint(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    message = message_of(tracker, gradient=gradients.Transport())
    assert "needs the package ott-jax; pip install" in message


def test_a_call_that_made_no_step_leaves_no_checkpoint(tmp_path):
    def fails(tracker, keys, frames):
        raise InputError("no package")

    with pytest.raises(InputError, match="no package"):
        jaxpf.tune(made_sequence(), SCALE, objective=fails, settings=QUICK, folder=tmp_path)
    assert not list(tmp_path.iterdir())
