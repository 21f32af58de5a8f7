"""Mistakes in a user's classes and frames: one sentence each, before anything is compiled."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import (
    InputError,
    dynamics,
    filters,
    measures,
    media,
    ordering,
    populations,
    proposals,
    shapes,
    smoothing,
)
from jaxpf.running.checks import check_run

FRAMES = np.zeros((3, 2, 2), np.float32)
KEYS = jax.random.split(jax.random.key(0))


@jaxpf.pytree_dataclass
class Drift:
    returned: str = jaxpf.contract.pytree.static_field(default="moved")

    def propagate(self, key, partition, current, previous, parent):
        return {
            "moved": current + jax.random.normal(key, current.shape),
            "longer": jnp.append(current, 0.0),
            "one": current[0],
            "complex": current + 1j,
            "nothing": None,
        }[self.returned]


@jaxpf.pytree_dataclass
class Near:
    returned: str = jaxpf.contract.pytree.static_field(default="sum")

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        each = -0.5 * (observation[partition] - substate) ** 2
        return {
            "sum": jnp.sum(each),
            "each": each,
            "nothing": None,
            "complex": jnp.sum(each) + 1j,
        }[self.returned]


class NoPytree:
    def propagate(self, key, partition, current, previous, parent):
        return current

    log_prob = observe = propagate


def tracker(dynamics=None, likelihood=None, **options):
    given = {"initial": jnp.zeros((2, 2)), "num_particles": 10, **options}
    return jaxpf.Partitioned(
        dynamics=dynamics or Drift(),
        likelihood=likelihood or Near(),
        ordering=ordering.ps([1, 0]),
        **given,
    )


def refused(made, frames=FRAMES):
    """The sentence, which both ways of running a tracker give."""
    found = []
    for run in (
        lambda: jaxpf.run(made, jax.random.key(0), frames),
        lambda: jaxpf.monte_carlo(made, jax.random.split(jax.random.key(0), 2), frames),
    ):
        with pytest.raises(InputError) as caught:
            run()
        found.append(str(caught.value))
    assert found[0] == found[1]
    assert "\n" not in found[0]
    return found[0]


def test_what_is_right_passes():
    check_run(tracker(), FRAMES)
    check_run(tracker(initial=jax.tree_util.Partial(lambda key: jnp.zeros((2, 2)))), FRAMES)


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (
            {"likelihood": Near("each")},
            "Near.log_prob returns an array of shape [2] where [] was expected; return a single "
            "number.",
        ),
        ({"likelihood": Near("nothing")}, "Near.log_prob returns nothing; return a single number."),
        (
            {"likelihood": Near("complex")},
            "Near.log_prob returns complex numbers; return real ones.",
        ),
        (
            {"dynamics": Drift("longer")},
            "Drift.propagate returns an array of shape [3] where [2] was expected; return the "
            "moved substate [D].",
        ),
        (
            {"dynamics": Drift("one")},
            "Drift.propagate returns an array of shape [] where [2] was expected; return the "
            "moved substate [D].",
        ),
        ({"dynamics": Drift("nothing")}, "Drift.propagate returns nothing; return the moved"),
        ({"dynamics": Drift("complex")}, "Drift.propagate returns complex numbers"),
        (
            {"likelihood": NoPytree()},
            "tracker.likelihood is a NoPytree, which is no pytree; decorate the class with "
            "@jaxpf.pytree_dataclass",
        ),
        ({"dynamics": NoPytree()}, "tracker.dynamics is a NoPytree, which is no pytree"),
        (
            {"initial": lambda key: jnp.zeros((2, 2))},
            "tracker.initial is a function, which is no pytree; wrap it in jax.tree_util.Partial.",
        ),
        (
            {"initial": jax.tree_util.Partial(lambda key: jnp.zeros(2))},
            "the initial sampler returns an array of shape [2] where [2, D] was expected",
        ),
    ],
)
def test_a_class_that_cannot_run_is_told_what_it_should_return(made, sentence):
    assert sentence in refused(tracker(**made))


def test_frames_as_a_list_are_refused():
    assert "frames is a list of 3; give one array" in refused(tracker(), list(FRAMES))


def test_complex_frames_are_refused():
    assert refused(tracker(), FRAMES + 1j) == "frames hold complex numbers; give real ones."


@pytest.mark.parametrize(
    ("initial", "sentence"),
    [
        ([[0, np.nan], [0, 0]], "holds 1 value(s) that are not finite, the first at [0, 1]"),
        ([[0, 1j], [0, 0]], "initial holds complex numbers"),
        ([[0, 1], [0]], "initial is list, not an array of numbers"),
        ("zeros", "initial is str, not an array of numbers"),
        (None, "initial is NoneType, not an array of numbers"),
    ],
)
def test_an_initial_state_that_is_no_finite_array_is_refused(initial, sentence):
    for make in (
        lambda: tracker(initial=initial),
        lambda: jaxpf.Labelled(Drift(), Near(), initial),
        lambda: jaxpf.PFFL(Drift(), Near(), initial),
    ):
        with pytest.raises(InputError) as caught:
            make()
        assert sentence in str(caught.value)


@pytest.mark.parametrize("order", ["10", [0.5, 1], 3, None, ["1", "0"]])
def test_an_order_that_is_no_list_of_whole_numbers_is_refused(order):
    with pytest.raises(InputError, match="is not a list of whole numbers"):
        ordering.ps(order)


def test_a_number_of_partitions_that_is_none_is_refused():
    for count in ("2", 2.5, True):
        with pytest.raises(InputError, match="must be a whole number"):
            ordering.sir(count)


@pytest.mark.parametrize("number", ["3", None, True, 2.0])
def test_a_number_of_particles_is_a_whole_number(number):
    for make in (
        lambda: tracker(num_particles=number),
        lambda: jaxpf.Labelled(Drift(), Near(), np.zeros((2, 2)), num_particles=number),
        lambda: jaxpf.PFFL(Drift(), Near(), np.zeros((2, 2)), num_particles=number),
    ):
        with pytest.raises(InputError, match=f"num_particles = {number!r} must be a whole number"):
            make()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: jaxpf.run(tracker(), 0, FRAMES), r"key is 0; give a random key, such as jax\."),
        (lambda: jaxpf.monte_carlo(tracker(), 0, FRAMES), "keys is 0; give one key per run"),
        (
            lambda: jaxpf.run(tracker(), KEYS, FRAMES),
            "key has shape",
        ),
        (lambda: jaxpf.run(tracker(), jax.random.key(0), "abc"), "frames hold a str; give arrays"),
        (lambda: tracker(initial=np.zeros((2, 2), bool)), "initial holds truth values"),
        (lambda: ordering.sps([1, 0, None]), r"parents \[1, 0, None\] is no list of whole numbers"),
        (lambda: ordering.named("ps", [-1, -1], order=3), "order 3 is not a list of whole numbers"),
        (lambda: ordering.sir(10**12), "num_partitions = 1000000000000 must be .* to 10000"),
        (lambda: jaxpf.run(None, KEYS[0], FRAMES), "tracker is None; give a tracker"),
        (lambda: jaxpf.run(tracker(likelihood=3.0), KEYS[0], FRAMES), "likelihood is 3.0, without"),
        (lambda: jaxpf.run(tracker(), KEYS[0], FRAMES, record=3), "record=3 must be a function"),
        (lambda: jaxpf.run(tracker(), KEYS[0], FRAMES, state=3), "state is int, no state of this"),
        (
            lambda: jaxpf.run(tracker(), KEYS[0], FRAMES, observed=[[1], []]),
            "observed=.* must be one",
        ),
        (lambda: next(jaxpf.stream(None, KEYS[0], FRAMES)), "tracker is None; give a tracker"),
        (lambda: next(jaxpf.stream(tracker(), KEYS[0], FRAMES, state=3)), "state is int, no state"),
        (lambda: next(jaxpf.stream(tracker(), KEYS[0], [None])), "frame 0 is None, as an"),
        (lambda: next(jaxpf.stream(tracker(), KEYS[0], 0)), "frames is int: give an Iterable"),
        (
            lambda: next(jaxpf.stream(tracker(), KEYS[0], FRAMES, observed=5.5)),
            "observed is float: give an Iterable",
        ),
        (
            lambda: next(jaxpf.stream(tracker(), KEYS[0], FRAMES, observed=np.ones((3, 5)))),
            "observed must be one bool for each frame",
        ),
        (
            lambda: next(smoothing.stream(tracker(dynamics.RandomWalk(1.0)), KEYS[0], None, lag=1)),
            "frames have leading axes",
        ),
        (lambda: smoothing.LookBack(tracker(dynamics.RandomWalk(1.0)), 0), "key is 0; give a rand"),
        (lambda: dynamics.WithOcclusion(Drift(), None, flip=2), "flip=2 must be one finite number"),
        (
            lambda: dynamics.RandomWalk(10**12),
            "scale=1000000000000 is too large",
        ),
        (
            lambda: dynamics.LinearGaussian(np.ones((2, 2, 2)), np.ones((2, 2, 1))),
            r"noise has shape \[2, 2, 1\]; give one finite matrix for each partition, \[2, 2, 2\]",
        ),
        (
            lambda: dynamics.LinearGaussian(np.full((2, 2, 2), np.nan), np.ones((2, 2, 2))),
            "transition=.* must be one finite matrix",
        ),
        (
            lambda: dynamics.IndependentGaussian(np.ones((2, 2)), np.ones(3)),
            r"mean \[2, 2\] and scale \[3\] do not go together",
        ),
        (
            lambda: dynamics.UniformAround(np.ones((2, 3)), np.ones(2)),
            r"poses \[2, 3\] and reach \[2\] do not go together",
        ),
        (
            lambda: dynamics.UniformJoints(3, np.ones((2, 3)), 1.0),
            "dynamics is int: give a RelativeToParent",
        ),
        (
            lambda: dynamics.joints_between(np.ones((2, 3)), [[1, 1], [1, -1]], (-1, 0)),
            "sizes=.* must be width and height",
        ),
        (lambda: filters.SideBySide(3), "tracker is 3; give a tracker"),
        (lambda: filters.WithErrorBars(tracker(), lag=1.5), "lag = 1.5 must be a whole number"),
        (lambda: filters.homes([True], -1), "num_particles = -1 must be a whole number"),
        (
            lambda: jaxpf.Eskil(Drift(), Near(), np.eye(2), reference=np.full((2, 2), np.nan)),
            "reference=.* must be positions, finite",
        ),
        (lambda: proposals.Mixture(3), "proposal is 3, without a method propose"),
        (lambda: tracker(initial_label=[[1], []]), "initial_label=.* must be the probability"),
        (lambda: media.open_frames(-1), "path = -1 must be a whole number from 0"),
        (lambda: media.open_frames(".", fps="a"), "fps='a' must be one finite number above 0"),
        (lambda: media.VideoWriter("a.mp4", None, 48, 25), "width = None must be a whole number"),
        (lambda: media.VideoWriter("a.mp4", 64, 48, None), "fps is NoneType: give a Real"),
        (
            lambda: media.draw_spreads(np.zeros((9, 9, 3), np.uint8), [[1, 2]], [[-1, 2]]),
            "spreads hold -1; give standard deviations",
        ),
        (
            lambda: jaxpf.run(tracker(dynamics.RandomWalk(np.ones(3))), KEYS[0], FRAMES),
            "RandomWalk does not fit 2 partitions of 2 coordinates",
        ),
        (
            lambda: jaxpf.run(tracker(dynamics.RandomWalk(np.ones((3, 2)))), KEYS[0], FRAMES),
            r"RandomWalk.scale has shape \[3, 2\], but there are 2 partitions",
        ),
        (lambda: dynamics.RandomWalk("wide"), "scale='wide' must be finite standard deviations"),
        (lambda: dynamics.RandomWalk([1, -1]), r"scale=\[1, -1\] must be finite"),
        (lambda: shapes.even_places(10**12, closed=True), "count = 1000000000000 must be a whole"),
        (lambda: shapes.area(np.ones((2, 3))), r"boxes has shape \[2, 3\]; give x, y, w, h"),
        (lambda: measures.mean_interval([1, 2], bounds=3), "bounds=3 must be the smallest"),
        (lambda: measures.crps([1, 2], [1, 2, 3]), r"offset \[2\] and spread \[3\] do not go"),
        (lambda: media.object_colours("a"), "num_objects = 'a' must be a whole number"),
        (lambda: populations.open_box_tracker(3), "frame_shape=3 must be height and width"),
        (lambda: next(populations.follow(3, KEYS[0], FRAMES)), "tracker is int: give a Labelled"),
    ],
)
def test_what_is_of_another_kind_is_told_in_one_sentence(call, sentence):
    with pytest.raises(InputError, match=sentence):
        call()


def test_a_start_of_half_precision_and_a_key_of_the_old_kind_will_do():
    half = tracker(initial=np.ones((2, 2), np.float16))
    assert half.initial.dtype == np.float32
    found = [jaxpf.run(half, key, FRAMES)[1] for key in (jax.random.key(3), jax.random.PRNGKey(3))]
    np.testing.assert_array_equal(found[0].estimate, found[1].estimate)


def test_a_tracker_equals_itself_alone():
    made = tracker()
    assert made == made
    assert made != tracker()
    assert made in {made}


@pytest.mark.parametrize("frames", [np.array(["a", "b"]), np.array([None, 1.0])])
def test_frames_that_are_no_numbers_are_refused(frames):
    with pytest.raises(InputError, match="arrays; give arrays of numbers"):
        jaxpf.run(tracker(), KEYS[0], frames)
