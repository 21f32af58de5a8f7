"""Tuning: parameters by path, bounds, descent, checkpoints, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import tuning
from jaxpf.errors import InputError
from jaxpf.filters.partitioned import ordering
from jaxpf.models.dynamics import RandomWalk
from jaxpf.models.likelihoods import Gaussian, histogram
from jaxpf.targets import find_target
from jaxpf.targets.target import Start
from jaxpf.tuning import Parameter, Settings, TrainingSequence, tune
from jaxpf.tuning.checkpoint import NAME
from jaxpf.tuning.comparison import HeldOut, compare


def tracker(scale=1.0, noise=1.0, **options):
    return jaxpf.Partitioned(
        dynamics=RandomWalk(scale=jnp.array([scale])),
        likelihood=Gaussian(noise=jnp.full((1, 1, 1), noise)),
        ordering=ordering.sir(1),
        initial=jnp.zeros((1, 1)),
        num_particles=50,
        **options,
    )


def made_sequence(seed=0, scale=1.0, noise=1.0, num_frames=8, **options):
    rng = np.random.default_rng(seed)
    places = np.cumsum(scale * rng.standard_normal((num_frames, 1, 1)), axis=0)
    frames = places + noise * rng.standard_normal(places.shape)
    return TrainingSequence(
        tracker(**options), np.float32(frames), truth=np.float32(places), name=f"sequence {seed}"
    )


QUICK = Settings(steps=8, repeats=2, window=2, tolerance=0.0)
SCALE = ["dynamics.scale"]


# Paths and bounds


def test_parameters_are_named_by_their_path():
    assert tuning.names(tracker()) == ["dynamics.scale", "likelihood.noise", "initial"]
    one = tuning.read(tracker(scale=3.0), Parameter("dynamics.scale[0]", low=0.0))
    assert one.shape == ()
    assert one == 3.0
    changed = tuning.replace(tracker(), {"dynamics.scale[0]": 5.0, "likelihood.noise": [[[2.0]]]})
    assert changed.dynamics.scale[0] == 5.0
    assert changed.likelihood.noise[0, 0, 0] == 2.0
    assert changed.num_particles == 50


def test_a_python_number_is_a_parameter_too():
    walk = dataclasses.replace(tracker(), dynamics=jaxpf.dynamics.AR2(scale=jnp.ones(1)))
    assert "dynamics.momentum" in tuning.names(walk)
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


def test_bounds_are_written_beside_the_path():
    assert tuning.parameter("likelihood.sharpness") == Parameter("likelihood.sharpness", 0.0)
    assert tuning.parameter("dynamics.scale[1]=0.5:9") == Parameter("dynamics.scale[1]", 0.5, 9.0)
    assert tuning.parameter("initial") == Parameter("initial")
    assert tuning.parameter("initial=:4").high == 4.0


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("dynamics.speed", "no parameter dynamics.speed; choose among dynamics.scale, likel"),
        ("num_particles", r"num_particles is a fixed setting \(50\)"),
        ("resampling", "resampling is a fixed setting"),
        ("ordering.order", "ordering.order belongs to the ordering"),
        ("dynamics.scale[1]", r"outside dynamics.scale, whose shape is \[1\]"),
        ("dynamics", "dynamics is a group of parameters"),
        ("tempering", "tempering is not set"),
        ("dynamics.scale=2:5", "starts at 1, but must lie between 2 and 5"),
        ("dynamics.scale=5:2", "the first must be the smaller"),
        ("dynamics.scale=5", "must have the form PATH or PATH=LOW:HIGH"),
        ("dynamics.scale[a]", "is no path"),
    ],
)
def test_a_parameter_that_cannot_be_tuned_is_refused_in_one_sentence(path, words):
    with pytest.raises(InputError, match=words) as raised:
        tune(made_sequence(), [path], settings=QUICK)
    assert "\n" not in str(raised.value)


def test_an_integer_leaf_is_refused():
    frame = np.random.default_rng(0).integers(0, 256, (40, 40, 3), dtype=np.uint8)
    with_histogram = dataclasses.replace(
        tracker(), likelihood=histogram(frame, [[5, 5, 12, 12]], form="density")
    )
    sequence = TrainingSequence(with_histogram, frame[None])
    with pytest.raises(InputError, match="bin_lookup holds int32, which has no gradient"):
        tune(sequence, ["likelihood.bin_lookup"])


def test_overlapping_parameters_are_refused():
    with pytest.raises(InputError, match="overlap; name each value once"):
        tune(made_sequence(), ["dynamics.scale", "dynamics.scale[0]"])
    with pytest.raises(InputError, match="no parameter was named"):
        tune(made_sequence(), [])


# Objectives


def test_objectives_need_what_they_are_about():
    sequence = made_sequence()
    with pytest.raises(InputError, match="objective 'speed' is unknown"):
        tune(sequence, SCALE, objective="speed")
    with pytest.raises(InputError, match="needs labels, but sequence 0 has none"):
        tune(dataclasses.replace(sequence, truth=None), SCALE, objective="position")
    with pytest.raises(InputError, match="needs the sizes"):
        tune(sequence, SCALE, objective="overlap")
    with pytest.raises(InputError, match="no sequence"):
        tune([], SCALE)


def test_an_evidence_that_is_not_normalised_is_refused():
    frame = np.random.default_rng(0).integers(0, 256, (40, 40, 3), dtype=np.uint8)
    plain = dataclasses.replace(tracker(), likelihood=histogram(frame, [[5, 5, 12, 12]]))
    with pytest.raises(InputError, match="always prefers sharpness 0"):
        tune(TrainingSequence(plain, frame[None]), ["likelihood.sharpness"])


def test_a_motion_without_gradient_is_refused():
    frame = np.random.default_rng(0).integers(0, 256, (40, 40, 3), dtype=np.uint8)
    whole = histogram(frame, [[5, 5, 12, 12]], form="density")
    sequence = TrainingSequence(dataclasses.replace(tracker(), likelihood=whole), frame[None])
    with pytest.raises(InputError, match="gradient of motion parameters would always be zero"):
        tune(sequence, SCALE)


# Descent


def test_the_evidence_is_raised_and_traced():
    result = tune(
        [made_sequence(seed, scale=1.0) for seed in range(3)],
        ["dynamics.scale=0.01:100"],
        settings=Settings(steps=40, repeats=2, window=10, seed=3),
    )
    wrong = tune(
        [made_sequence(seed, scale=20.0) for seed in range(3)],
        SCALE,
        settings=Settings(steps=60, repeats=2, window=10, seed=3),
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
    assert result.apply(tracker()).dynamics.scale == result.values["dynamics.scale"]


def test_supervised_and_own_objectives_are_lowered():
    sequence = made_sequence(1, scale=5.0, noise=0.2)
    sequence = dataclasses.replace(sequence, tracker=tracker(scale=0.3, noise=0.2))
    sequence = dataclasses.replace(
        sequence, truth=np.concatenate([sequence.truth, 0 * sequence.truth], axis=-1)
    )
    two = jnp.zeros((1, 2))
    wide = dataclasses.replace(
        sequence.tracker,
        initial=two,
        dynamics=RandomWalk(scale=jnp.array([0.3])),
        likelihood=Gaussian(noise=0.2 * jnp.eye(2)[None]),
    )
    frames = np.concatenate([sequence.frames, 0 * sequence.frames], axis=-1)
    sequence = dataclasses.replace(sequence, tracker=wide, frames=frames)
    result = tune(sequence, SCALE, objective="position", settings=Settings(steps=30, repeats=1))
    assert result.values["dynamics.scale"][0] > 0.6
    assert np.isnan(result.spread_errors["dynamics.scale"]).all()
    assert np.isnan(result.curvature_errors["dynamics.scale"]).all()

    own = tune(
        made_sequence(), SCALE, objective=_squared_scale, settings=Settings(steps=20, repeats=1)
    )
    assert own.values["dynamics.scale"][0] < 0.5


def _squared_scale(tracker, keys, frames):
    return jnp.full(len(keys), jnp.sum(tracker.dynamics.scale**2))


def test_common_random_numbers_make_the_loss_one_function():
    still = Settings(steps=4, learning_rate=1e-9, repeats=1, random_numbers="common")
    losses = tune(made_sequence(), SCALE, settings=still).descents[0].loss
    np.testing.assert_allclose(losses, losses[0], rtol=1e-5)
    fresh = dataclasses.replace(still, random_numbers="fresh")
    assert np.std(tune(made_sequence(), SCALE, settings=fresh).descents[0].loss) > 1e-3


def test_it_stops_when_values_have_settled():
    settings = Settings(steps=200, window=5, tolerance=0.05, repeats=1, learning_rate=0.05)
    descent = tune(made_sequence(), SCALE, settings=settings).descents[0]
    assert descent.stopped == "settled"
    assert descent.num_steps < 200
    hasty = dataclasses.replace(settings, steps=6)
    assert tune(made_sequence(), SCALE, settings=hasty).descents[0].stopped == "all steps"


def test_clipping_bounds_the_gradient_not_its_trace():
    settings = Settings(steps=3, repeats=1, clip=1e-3)
    descent = tune(made_sequence(), SCALE, settings=settings).descents[0]
    assert (descent.gradient_norm > 1e-3).all()


def test_sequences_take_turns():
    sequences = [made_sequence(seed) for seed in range(3)]
    settings = Settings(steps=3, repeats=1, sequences_per_step=1, learning_rate=1e-9)
    turns = tune(sequences, SCALE, settings=settings).descents[0].loss
    all_ = dataclasses.replace(settings, sequences_per_step=None, random_numbers="common")
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
    from jaxpf.models.likelihoods.gaussian import kalman

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


def _fails_from_step(step, limit=0.5):
    def objective(tracker, keys, frames):
        scale = tracker.dynamics.scale[0]
        return jnp.full(len(keys), jnp.where(scale < limit, jnp.nan, scale))

    return objective


def test_a_loss_that_is_no_number_stops_and_keeps_the_last_good_values(tmp_path):
    settings = Settings(steps=50, repeats=1, learning_rate=0.2)
    with pytest.raises(tuning.Diverged) as raised:
        tune(
            made_sequence(),
            SCALE,
            objective=_fails_from_step(0),
            settings=settings,
            folder=tmp_path,
        )
    text = str(raised.value)
    assert "the loss became no number on sequence 0 of step" in text
    assert "the last good values are dynamics.scale = " in text
    assert "\n" not in text
    last = raised.value.result.last_good["dynamics.scale"][0]
    assert 0.3 < last < 1.0
    assert (tmp_path / NAME).is_file()


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
    assert not [p for p in tmp_path.iterdir() if p.name != NAME]


def test_a_checkpoint_of_other_settings_is_refused(tmp_path):
    settings = dataclasses.replace(QUICK, steps=2)
    tune(made_sequence(), SCALE, settings=settings, folder=tmp_path)
    more = dataclasses.replace(settings, learning_rate=0.2)
    with pytest.raises(InputError, match=r"was begun with learning_rate = 0.1, now 0.2"):
        tune(made_sequence(), SCALE, settings=more, folder=tmp_path)
    other = dataclasses.replace(made_sequence(5), name="sequence 0")
    with pytest.raises(InputError, match="was begun with content"):
        tune(other, SCALE, settings=settings, folder=tmp_path)
    (tmp_path / NAME).write_bytes(b"no archive")
    with pytest.raises(InputError, match="is damaged"):
        tune(made_sequence(), SCALE, settings=settings, folder=tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"steps": 0}, "steps = 0"),
        ({"learning_rate": 0.0}, "learning_rate = 0.0"),
        ({"clip": np.inf}, "clip = inf"),
        ({"tolerance": -1.0}, "tolerance = -1.0"),
        ({"random_numbers": "old"}, "random_numbers 'old'"),
        ({"seed": -1}, "seed = -1"),
    ],
)
def test_settings_out_of_range_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        Settings(**change)


# Comparison


def test_the_comparison_pairs_runs_and_names_its_unit():
    rng = np.random.default_rng(0)
    centres = np.cumsum(rng.normal(0, 2, (10, 1, 2)), axis=0)
    truth = np.concatenate([centres - 5, np.full((10, 1, 2), 10.0)], axis=-1)
    frames = np.float32(np.concatenate([centres, np.ones((10, 1, 1))], axis=-1))

    def one(scale):
        return jaxpf.Partitioned(
            dynamics=RandomWalk(scale=jnp.array([scale, scale, 0.0])),
            likelihood=Gaussian(noise=0.5 * jnp.eye(3)[None]),
            ordering=ordering.sir(1),
            initial=jnp.array([[0.0, 0.0, 1.0]]),
            num_particles=50,
        )

    start = Start(np.array([1]), truth[0], np.full((1, 2), 10.0), (-1,))
    held_out = HeldOut(one(0.05), one(2.0), frames, truth, find_target("boxes"), start)
    single = compare([held_out], runs=6)
    assert (single.unit, single.count) == ("runs", 6)
    assert single.verdict("overlap") == "better"
    assert single.verdict("centre error") == "better"
    several = compare([held_out, held_out, held_out], runs=6)
    assert (several.unit, several.count) == ("sequences", 3)
    same = compare([dataclasses.replace(held_out, after=held_out.before)], runs=6)
    assert same.verdict("overlap") == "no clear difference"
    assert float(same.difference["overlap"].value) == 0.0
    with pytest.raises(InputError, match="gives no interval"):
        compare([held_out], runs=1)


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
