"""Mistakes in a user's classes and frames: one sentence each, before anything is compiled."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import every, message_of

import jaxpf
from jaxpf import (
    dynamics,
    filters,
    measures,
    media,
    ordering,
    shapes,
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
    one, other = (
        message_of(run, made, key, frames)
        for run, key in ((jaxpf.run, KEYS[0]), (jaxpf.monte_carlo, KEYS))
    )
    assert one == other
    return one


def test_what_is_right_passes():
    check_run(tracker(), FRAMES)
    check_run(tracker(initial=jax.tree_util.Partial(lambda key: jnp.zeros((2, 2)))), FRAMES)


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        ({"likelihood": Near("each")}, "Near.log_prob returns shape [2]; return a single number."),
        ({"likelihood": Near("nothing")}, "Near.log_prob returns nothing; return a single number."),
        ({"likelihood": Near("complex")}, "returns complex numbers; return real ones."),
        ({"dynamics": Drift("longer")}, "returns shape [3]; return the moved"),
        ({"dynamics": Drift("one")}, "returns shape []; return the moved"),
        ({"dynamics": Drift("nothing")}, "Drift.propagate returns nothing; return the moved"),
        ({"dynamics": Drift("complex")}, "Drift.propagate returns complex numbers"),
        (
            {"likelihood": NoPytree()},
            "likelihood is a NoPytree, which is not a pytree; decorate the",
        ),
        ({"dynamics": NoPytree()}, "tracker.dynamics is a NoPytree, which is not a pytree"),
        (
            {"initial": jax.tree_util.Partial(lambda key: jnp.zeros(2))},
            "the initial sampler returns shape [2]; return [2, D].",
        ),
    ],
)
def test_a_class_that_cannot_run_is_told_what_it_should_return(made, sentence):
    assert sentence in refused(tracker(**made))


@pytest.mark.parametrize(("frames", "sentence"), [
    (list(FRAMES), "frames is a list of 3; give one array"),
    (FRAMES + 1j, "frames hold complex numbers; give real ones."),
    (np.zeros((0, 2, 2)), "leading axes [0]"),
    (np.float64(1.0), "leading axes [0]"),
    ({"a": np.zeros((2, 1)), "b": np.zeros((3, 1))}, "leading axes [2, 3]"),
    ({}, "leading axes []"),
    (np.array(["a", "b"]), "arrays; give arrays of numbers"),
])  # fmt: skip
def test_frames_that_are_no_array_of_numbers_are_refused(frames, sentence):
    assert sentence in refused(tracker(), frames)


#: Of an initial state and a number of particles, each filter has its own.
FILTERS = (
    tracker,
    lambda **given: jaxpf.Labelled(Drift(), Near(), **{"initial": np.zeros((2, 2))} | given),
    lambda **given: jaxpf.PFFL(Drift(), Near(), **{"initial": np.zeros((2, 2))} | given),
)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"initial": [[0, np.nan], [0, 0]]}, "[0, 1]"),
        ({"initial": [[0, 1j], [0, 0]]}, "complex"),
        ({"initial": [[0, 1], [0]]}, "initial"),
        ({"num_particles": 0}, "num_particles"),
    ],
)
def test_every_filter_checks_its_start_and_its_number_of_particles(given, sentence):
    for make in FILTERS:
        assert sentence in message_of(make, **given)


WALK, PICTURE = dynamics.RandomWalk, np.zeros((9, 9, 3), np.uint8)


def walk(scale=1.0):
    return tracker(WALK(scale))


def run(made=None, frames=FRAMES, key=KEYS[0], **given):
    return jaxpf.run(tracker() if made is None else made, key, frames, **given)


def stream(made=None, frames=FRAMES, **given):
    return next(jaxpf.stream(tracker() if made is None else made, KEYS[0], frames, **given))


@every([
    (lambda: run(key=KEYS), "key"),
    (lambda: run(observed=[[1], []]), "observed"),
    (lambda: run(walk(np.ones(3))), "2 partitions of 2 coordinates"),
    (lambda: run(walk(np.ones((3, 2)))), "RandomWalk.scale has shape [3, 2]"),
    (lambda: jaxpf.monte_carlo(tracker(), KEYS[0], FRAMES), "keys"),
    (lambda: jaxpf.monte_carlo(tracker(), KEYS[:0], FRAMES), "keys"),
    (lambda: jaxpf.monte_carlo(tracker(), KEYS, FRAMES, batch_size=0), "batch_size"),
    (lambda: tracker(initial=np.zeros((2, 2), bool)), "initial"),
    (lambda: stream(frames=[None]), "frame 0"),
    (lambda: stream(observed=np.ones((3, 5))), "observed"),
    (lambda: dynamics.WithOcclusion(Drift(), None, flip=2), "flip"),
    (lambda: WALK(10**12), "scale"),
    (lambda: WALK([1, -1]), "scale"),
    (lambda: dynamics.LinearGaussian(np.ones((2, 2, 2)), np.ones((2, 2, 1))), "one finite matrix"),
    (lambda: dynamics.LinearGaussian(np.full((2, 2, 2), np.nan), np.ones((2, 2, 2))), "one finite"),
    (lambda: dynamics.IndependentGaussian(np.ones((2, 2)), np.ones(3)), "mean"),
    (lambda: dynamics.UniformAround(np.ones((2, 3)), np.ones(2)), "reach"),
    (lambda: dynamics.joints_between(np.ones((2, 3)), [[1, 1], [1, -1]], (-1, 0)), "width"),
    (lambda: filters.assign_slots([True], -1), "num_particles"),
    (lambda: media.draw_spreads(PICTURE, [[1, 2]], [[-1, 2]]), "spreads"),
    (lambda: shapes.even_places(10**12, closed=True), "count"),
    (lambda: shapes.area(np.ones((2, 3))), "boxes"),
    (lambda: measures.crps([1, 2], [1, 2, 3]), "offset"),
])  # fmt: skip
def test_what_does_not_fit_is_named(call, named):
    assert named in message_of(call)


def test_a_start_of_half_precision_will_do():
    half = tracker(initial=np.ones((2, 2), np.float16))
    assert half.initial.dtype == np.float32
    check_run(half, FRAMES)


def test_a_tracker_equals_itself_alone():
    made = tracker()
    assert made == made
    assert made != tracker()
    assert made in {made}
