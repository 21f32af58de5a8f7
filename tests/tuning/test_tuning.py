"""Tuning: objectives, descent, checkpoints, refusals."""

import dataclasses
import importlib.util

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import norm
from refusals import every, message_of
from small_tuning import QUICK, SCALE, made_sequence, tracker

from jaxpf import InputError, state_space, tune
from jaxpf.dynamics import RandomWalk
from jaxpf.gradients import StopGradient, Transport
from jaxpf.likelihoods import Gaussian, histogram
from jaxpf.tuning import Settings, TrainingSequence
from jaxpf.tuning.loop import Diverged
from jaxpf.tuning.parameters import Parameter
from jaxpf.tuning.result import Descent, Result

UNLABELLED = dataclasses.replace(made_sequence(), truth=None)


def of_histograms(**form):
    frame = np.random.default_rng(0).integers(0, 256, (40, 40, 3), dtype=np.uint8)
    likelihood = histogram(frame, [[5, 5, 12, 12]], **form)
    return TrainingSequence(dataclasses.replace(tracker(), likelihood=likelihood), frame[None])


@every([
    (lambda: tune(made_sequence(), SCALE, objective="speed"), "'speed'"),
    (lambda: tune(UNLABELLED, SCALE, objective="position"), "sequence 0"),
    (lambda: tune(made_sequence(), SCALE, objective="iou"), "sizes"),
    (lambda: tune([], SCALE), "no sequence"),
    (lambda: tune(of_histograms(), ["likelihood.sharpness"]), "always prefers sharpness 0"),
    (lambda: tune(of_histograms(form="density"), SCALE), "motion parameters"),
    (lambda: tune(of_histograms(form="density"), ["likelihood.bin_lookup"]), "holds int32"),
])  # fmt: skip
def test_what_cannot_be_tuned_is_refused(call, named):
    assert named in message_of(call)


@pytest.mark.parametrize("score", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_parameter_that_acts_through_integers_needs_the_score(score):
    """A regime that stays with probability q: no particle's path has a slope in it."""

    def model(**options):
        return state_space(
            initial=jnp.int32(0),
            transition=lambda key, x, p: jnp.where(jax.random.bernoulli(key, p["q"]), x, 1 - x),
            transition_log_density=lambda new, x, p: jnp.log(
                jnp.where(new == x, p["q"], 1 - p["q"])
            ),
            log_likelihood=lambda y, x, p: norm.logpdf(y, 2.0 * x, 0.7),
            parameters={"q": 0.7},
            num_particles=50,
            **options,
        )

    frames = np.zeros(5, np.float32)
    wanted, settings = ["parameters.q=0:1"], Settings(steps=2, repeats=1, runs=2)
    if score:
        by_score = TrainingSequence(model(motion_gradient="score"), frames)
        assert tune(by_score, wanted, settings=settings).values["parameters.q"] > 0.7
        return
    with pytest.warns(UserWarning, match="motion_gradient='score'"):
        model(gradient=StopGradient())
    refused = TrainingSequence(model(), frames)
    assert "parameters.q" in message_of(tune, refused, wanted, settings=settings)


# Descent


def test_the_evidence_is_raised_and_traced():
    settings = Settings(steps=40, repeats=2, window=10, seed=3)
    result, wrong = (
        tune([made_sequence(seed, scale=scale) for seed in range(3)], paths, settings=settings)
        for scale, paths in ((1.0, ["dynamics.scale=0.01:100"]), (20.0, SCALE))
    )
    assert 0.3 < result.values["dynamics.scale"][0] < 2.5
    assert wrong.values["dynamics.scale"][0] > 5
    first = wrong.descents[0]
    assert first.loss[-5:].mean() < first.loss[:5].mean()
    assert first.free["dynamics.scale"].shape == (first.num_steps + 1, 1)
    assert (first.gradient_norm > 0).all()
    assert np.isfinite(wrong.spread_errors["dynamics.scale"]).all()
    low, high = result.intervals()["dynamics.scale"]
    assert low < result.values["dynamics.scale"] < high


def test_supervised_and_own_objectives_are_lowered():
    """In two dimensions, of which the second stays 0."""
    sequence = made_sequence(1, scale=5.0, noise=0.2)
    wide = dataclasses.replace(
        tracker(),
        initial=jnp.zeros((1, 2)),
        dynamics=RandomWalk(scale=jnp.array([0.3])),
        likelihood=Gaussian(noise=0.2 * jnp.eye(2)[None]),
    )
    truth, frames = (
        np.concatenate([each, 0 * each], axis=-1) for each in (sequence.truth, sequence.frames)
    )
    sequence = dataclasses.replace(sequence, tracker=wide, frames=frames, truth=truth)
    result = tune(sequence, SCALE, objective="position", settings=Settings(steps=30, repeats=1))
    assert result.values["dynamics.scale"][0] > 0.6
    assert np.isnan(result.spread_errors["dynamics.scale"]).all()
    assert np.isnan(result.curvature_errors["dynamics.scale"]).all()

    def squared_scale(tracker, keys, frames):
        return jnp.full(len(keys), jnp.sum(tracker.dynamics.scale**2))

    few = Settings(steps=20, repeats=1)
    own = tune(made_sequence(), SCALE, objective=squared_scale, settings=few)
    assert own.values["dynamics.scale"][0] < 0.5


def test_it_stops_when_values_have_settled():
    settings = Settings(steps=200, window=5, tolerance=0.05, repeats=1, learning_rate=0.05)
    result = tune(made_sequence(), SCALE, settings=settings)
    assert result.descents[0].stopped == "settled"
    assert result.descents[0].num_steps < 200
    assert result.settled
    assert not any("settled" in remark for remark in result.remarks)
    hasty = tune(made_sequence(), SCALE, settings=dataclasses.replace(settings, steps=6))
    assert hasty.descents[0].stopped == "all steps"
    assert not hasty.settled
    assert "1 of 1 repeats stopped before they settled: the errors leave out" in hasty.remarks[0]


def test_clipping_bounds_the_gradient_not_its_trace():
    settings = Settings(steps=3, repeats=1, clip=1e-3, seed=2**32 - 1)
    descent = tune(made_sequence(), SCALE, settings=settings).descents[0]
    assert (descent.gradient_norm > 1e-3).all()


def test_sequences_take_turns():
    sequences = [made_sequence(seed) for seed in range(3)]
    settings = Settings(steps=3, repeats=1, sequences_per_step=1, learning_rate=1e-9)
    turns = tune(sequences, SCALE, settings=settings).descents[0].loss
    all_ = dataclasses.replace(settings, sequences_per_step=None)
    together = tune(sequences, SCALE, settings=all_).descents[0].loss
    assert abs(turns.mean() - together.mean()) < 0.5
    assert np.std(turns) > 5 * np.std(together)


@pytest.mark.slow
def test_the_curvature_gives_the_error_of_the_kalman_information():
    """Observed information of log scale, against second differences of the exact evidence."""
    sequences = [made_sequence(seed, num_frames=8) for seed in range(12)]
    settings = Settings(steps=60, repeats=2, window=20, runs=8)
    sharp = [
        dataclasses.replace(s, tracker=dataclasses.replace(s.tracker, num_particles=200))
        for s in sequences
    ]
    result = tune(sharp, SCALE, settings=settings)
    from jaxpf.likelihoods import kalman

    def exact(z):
        q = np.exp(z) ** 2
        return sum(
            kalman(
                np.eye(1), q * np.eye(1), np.eye(1), np.eye(1), np.zeros(1), np.zeros((1, 1)),
                s.frames[:, 0],
            )[0].sum()
            for s in sequences
        )  # fmt: skip

    z = float(result.free["dynamics.scale"][0])
    information = -(exact(z + 0.15) - 2 * exact(z) + exact(z - 0.15)) / 0.15**2
    error = float(result.curvature_errors["dynamics.scale"][0])
    assert abs(error / information**-0.5 - 1) < 0.3


# Trouble


def test_a_loss_that_is_no_number_stops_and_keeps_the_last_good_values(tmp_path):
    def fails_below_a_half(tracker, keys, frames):
        scale = tracker.dynamics.scale[0]
        return jnp.full(len(keys), jnp.where(scale < 0.5, jnp.nan, scale))

    settings = Settings(steps=50, repeats=1, learning_rate=0.2)
    given = {"objective": fails_below_a_half, "settings": settings, "folder": tmp_path}
    with pytest.raises(Diverged) as raised:
        tune(made_sequence(), SCALE, **given)
    text = str(raised.value)
    assert "the loss became no number on sequence 0 of step" in text
    assert "the last good values are dynamics.scale = " in text
    assert "\n" not in text
    assert 0.3 < raised.value.result.last_good["dynamics.scale"][0] < 1.0
    assert {path.name for path in tmp_path.iterdir()} == {"settings.json", "repeat-0.npz"}


# Checkpoints


def test_an_interrupted_descent_goes_on_to_the_same_values(tmp_path):
    whole = tune(made_sequence(), SCALE, settings=QUICK)
    steps = 0

    def interrupt(descent):
        nonlocal steps
        steps += 1
        if steps == 11:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune(made_sequence(), SCALE, settings=QUICK, folder=tmp_path, progress=interrupt)
    again = []
    resumed = tune(made_sequence(), SCALE, settings=QUICK, folder=tmp_path, progress=again.append)
    assert len(again) == 16 - 11
    for one, other in zip(whole.descents, resumed.descents, strict=True):
        np.testing.assert_array_equal(one.loss, other.loss)
        np.testing.assert_array_equal(one.free["dynamics.scale"], other.free["dynamics.scale"])
    assert len(list(tmp_path.iterdir())) == 1 + QUICK.repeats


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    folder = tmp_path_factory.mktemp("begun")
    tune(made_sequence(), SCALE, settings=QUICK, folder=folder)
    return folder


def other_frames():
    sequence = made_sequence()
    sequence.frames[3] += 1
    return sequence


@pytest.mark.parametrize(
    ("sequence", "named"),
    [
        (made_sequence(gradient=StopGradient()), "tracker"),
        (made_sequence(resampling="multinomial"), "tracker"),
        (dataclasses.replace(made_sequence(), tracker=tracker(noise=2.0)), "tracker"),
        (other_frames(), "frames"),
    ],
)
def test_what_differs_from_the_call_that_began_is_named(begun, sequence, named):
    message = message_of(tune, sequence, SCALE, settings=QUICK, folder=begun)
    assert f"another value of {named};" in message
    faster = dataclasses.replace(QUICK, learning_rate=0.2)
    message = message_of(tune, made_sequence(), SCALE, settings=faster, folder=begun)
    assert "was begun with learning_rate = 0.1, now 0.2" in message


def test_a_missing_package_is_told_before_there_is_a_checkpoint(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    message = message_of(tracker, gradient=Transport())
    assert "needs the package ott-jax; pip install" in message


def test_a_call_that_made_no_step_leaves_no_checkpoint(tmp_path):
    def fails(tracker, keys, frames):
        raise InputError("no package")

    with pytest.raises(InputError, match="no package"):
        tune(made_sequence(), SCALE, objective=fails, settings=QUICK, folder=tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_traces_are_drawn():
    from jaxpf.tuning.plot import traces

    result = tune(made_sequence(), ["dynamics.scale", "likelihood.noise=0.1:9"], settings=QUICK)
    figure = traces(result, "loss")
    labels = [axis.get_ylabel() for axis in figure.axes if axis.get_visible()]
    assert labels == [
        "loss",
        "norm of the gradient",
        "dynamics.scale[0]",
        "likelihood.noise[0][0][0]",
    ]


@pytest.mark.parametrize(
    ("repeats", "spread", "curvature", "reach"),
    [
        # Student's t of 2 degrees of freedom: 4.303; of none that count, the normal 1.960.
        (3, 1.0, np.nan, 4.303),
        (1, np.nan, 1.0, 1.960),
        (3, 1e-6, 1.0, 1.960),
        # Welch and Satterthwaite: 2 (1 + 1)^2 = 8 degrees of freedom: 2.306 times the root of 2.
        (3, 1.0, 1.0, 2.306 * 2**0.5),
        (2, 1.0, np.nan, np.nan),
    ],
)
def test_intervals_are_students(repeats, spread, curvature, reach):
    descent = Descent(0, {}, np.zeros(1), np.zeros(1), [], "settled")
    result = Result(
        parameters=(Parameter("x"),),
        start={"x": np.zeros(1)},
        free={"x": np.ones(1)},
        spread_errors={"x": np.array([spread])},
        curvature_errors={"x": np.array([curvature])},
        descents=[descent] * repeats,
    )
    low, high = result.intervals()["x"]
    assert (1 - low, high - 1) == pytest.approx((reach, reach), abs=1e-3, nan_ok=True)
    assert "nan" not in repr(result)
