"""Running trackers: keys, batches, records, and what they cost to compile."""

import subprocess
import sys

import jax
import numpy as np
import pytest
from models import Adding
from records import assert_equal

import jaxpf
from jaxpf import ordering, pytree_dataclass
from jaxpf.dynamics import RandomWalk
from jaxpf.likelihoods import Gaussian
from jaxpf.running.blocks import WIDE, blocks_of

pytestmark = pytest.mark.compiled_as_by_users

FRAMES = np.random.default_rng(0).normal(size=(4, 3, 1))


@pytree_dataclass
class TracedWalk(RandomWalk):
    """Counts how often it is traced, that is, for how many programs."""

    def propagate_all(self, *arguments):
        traced.append(0)
        return super().propagate_all(*arguments)


traced: list[int] = []
KEY = jax.random.key(3)
KEYS = jax.random.split(jax.random.key(5), 3)


def tracker(order=None, **settings):
    """One program for runs of a number of frames, and one for three runs beside each other."""
    settings = {"num_particles": 50, "dynamics": TracedWalk(np.float64(1.0))} | settings
    return jaxpf.Partitioned(
        likelihood=Gaussian(noise=np.ones((3, 1, 1))),
        ordering=ordering.ps([0, 1, 2]) if order is None else order,
        initial=np.zeros((3, 1)),
        **settings,
    )


def twice_the_state(state, summary):
    return {"state": 2 * state}


def test_same_key_gives_the_same_bits_and_another_key_does_not():
    """A key of the old kind is the same key."""
    made = tracker()
    one = jaxpf.run(made, KEY, FRAMES)
    assert_equal(one, jaxpf.run(made, KEY, FRAMES))
    assert_equal(one, jaxpf.run(made, jax.random.PRNGKey(3), FRAMES))
    other = jaxpf.run(made, jax.random.key(1), FRAMES)
    assert not np.array_equal(one[0].substates, other[0].substates)


@pytest.mark.slow
@pytest.mark.parametrize("float64", [False, True], ids=["float32", "float64"])
def test_a_run_does_not_depend_on_how_many_runs_share_its_batch(float64):
    """Bit for bit, for 1, 7 and 20 runs in batches of one width."""
    with jax.enable_x64(float64):
        made = tracker(ordering.dps(3))
        keys = jax.random.split(jax.random.key(5), 20)
        all_runs = jax.device_get(jaxpf.monte_carlo(made, keys, FRAMES))
        assert all_runs.estimate.dtype == (np.float64 if float64 else np.float32)
        for count in (1, 7):
            fewer = jaxpf.monte_carlo(made, keys[:count], FRAMES)
            assert_equal(fewer, jax.tree.map(lambda x, n=count: x[:n], all_runs))
        shuffled = jaxpf.monte_carlo(made, keys[::-1], FRAMES)
        assert_equal(shuffled, jax.tree.map(lambda x: x[::-1], all_runs))


def test_monte_carlo_agrees_with_single_runs_and_puts_runs_before_frames():
    made = tracker()
    together = jax.device_get(jaxpf.monte_carlo(made, KEYS, FRAMES))
    assert_equal(together, jaxpf.monte_carlo(made, jax.random.key_data(KEYS), FRAMES))
    for number, key in enumerate(KEYS):
        alone = jaxpf.run(made, key, FRAMES)[1]
        np.testing.assert_allclose(together.estimate[number], alone.estimate, atol=1e-4)
    assert together.log_evidence.shape == (3, 4)
    assert together.distinct_share.shape == (3, 4, 3)


def test_changing_ordering_or_parameters_compiles_nothing_new():
    jaxpf.run(tracker(ordering.sir(3)), KEY, FRAMES)
    jaxpf.monte_carlo(tracker(ordering.sir(3)), KEYS, FRAMES)
    before = len(traced)
    assert before > 0
    jaxpf.run(tracker(dynamics=TracedWalk(np.float64(2.0))), KEY, FRAMES)
    for other in (
        ordering.ps([2, 0, 1]),
        ordering.dps(3),
        ordering.dps(3, reassembly="literal"),
        *(ordering.sps(num_partitions=3, swap=swap) for swap in ordering.SWAPS),
    ):
        jaxpf.run(tracker(other), KEY, FRAMES)
        jaxpf.monte_carlo(tracker(other), KEYS, FRAMES)
    assert len(traced) == before


def test_a_run_is_a_fold_of_steps_with_the_documented_keys_which_compile_once():
    made = tracker()
    state, summaries, counts = made.init(jax.random.fold_in(KEY, 0)), [], []
    for time, frame in enumerate(FRAMES, 1):
        state, summary = made.step(jax.random.fold_in(KEY, time), state, frame)
        summaries.append(summary)
        counts.append(len(traced))
    assert counts[0] == counts[-1]
    for one, other in zip(summaries, jaxpf.stream(made, KEY, FRAMES), strict=True):
        assert_equal(one, other.summary)
    last, whole = jaxpf.run(made, KEY, FRAMES)
    np.testing.assert_allclose(last.substates, state.substates, rtol=1e-5, atol=1e-6)
    evidence = [summary.log_evidence for summary in summaries]
    np.testing.assert_allclose(whole.log_evidence, evidence, rtol=1e-5)
    before = len(traced)
    other = tracker(dynamics=TracedWalk(np.float64(2.0)))
    assert_equal(other.init(KEY), made.init(KEY))
    moved = other.step(KEY, state, FRAMES[0])[0]
    assert len(traced) == before
    assert not np.array_equal(moved.substates, made.step(KEY, state, FRAMES[0])[0].substates)


def test_a_tracker_that_is_no_pytree_steps_as_it_is_written():
    class Plain(jaxpf.contract.Tracker):
        def init(self, key):
            return 0.0

        def step_observed(self, key, state, observation):
            return state + float(observation), type(observation)

    assert Plain().step(None, 1.0, 2.0) == (3.0, float)


@pytree_dataclass
class CountingLikelihood:
    """Counts, while the program runs, how often a frame is observed."""

    noise: jax.Array

    def observe(self, frame):
        jax.debug.callback(lambda _: observed.append(0), frame)
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[partition, 0] - substate[0]) ** 2


observed: list[int] = []


def test_a_frame_is_observed_once_for_all_runs():
    made = jaxpf.Partitioned(
        dynamics=RandomWalk(np.float64(1.0)),
        likelihood=CountingLikelihood(np.float64(1.0)),
        ordering=ordering.sir(1),
        initial=np.zeros((1, 1)),
        num_particles=5,
    )
    observed.clear()
    keys = jax.random.split(jax.random.key(0), 6)  # three batches
    jax.block_until_ready(jaxpf.monte_carlo(made, keys, FRAMES, batch_size=2))
    jax.effects_barrier()
    assert len(observed) == len(FRAMES)


SPEEDS = {"speed": np.float32([1.0, 2.0, 3.0])}


@pytree_dataclass
class Accumulator(Adding):
    """No particles, no ``observe``; its frames and its reports are trees."""

    def step(self, key, state, frame):
        return state + frame["speed"], {"before": state, "nothing": None}


@pytree_dataclass
class Inheriting(Accumulator, jaxpf.contract.Tracker):
    """Defines ``step`` alone, and inherits the rest."""


@pytest.mark.parametrize("kind", [Accumulator, Inheriting])
def test_any_object_with_init_and_step_can_be_run_and_record_picks_what_is_kept(kind):
    made, keys = kind(), jax.random.split(jax.random.key(0), 11)
    final, report = jaxpf.run(made, KEY, SPEEDS)
    assert final == 6.0
    np.testing.assert_array_equal(report["before"], [0.0, 1.0, 3.0])
    many = jaxpf.monte_carlo(made, keys, SPEEDS)
    np.testing.assert_array_equal(many["before"], [[0.0, 1.0, 3.0]] * 11)
    assert report["nothing"] is many["nothing"] is None
    _, kept = jaxpf.run(made, KEY, SPEEDS, record=twice_the_state)
    np.testing.assert_array_equal(kept["state"], [2.0, 6.0, 12.0])
    many = jaxpf.monte_carlo(made, keys, SPEEDS, record=twice_the_state)
    np.testing.assert_array_equal(many["state"], [[2.0, 6.0, 12.0]] * 11)


def test_few_runs_cost_about_their_share_of_many():
    """A block costs as much as its runs and .8 of one, which starts it."""
    for count in (*range(1, 200), 750):
        blocks = blocks_of(count)
        assert len(blocks) <= 2
        filled = sum(number * width for number, width in blocks)
        assert count <= filled <= count + 5
        share = count * (1 + 0.8 / WIDE)
        cost = sum(number * (width + 0.8) for number, width in blocks)
        assert cost <= (1.5 if count >= 4 else 2) * share, count


@pytest.mark.slow
def test_runs_that_are_added_leave_the_bits_of_full_blocks():
    """In blocks of another width they are equal to rounding."""
    keys = jax.random.split(jax.random.key(0), 50)
    more = jaxpf.monte_carlo(tracker(), keys, FRAMES)
    for count, whole in ((3, 0), (29, 25)):
        fewer = jaxpf.monte_carlo(tracker(), keys[:count], FRAMES)
        for one, other in zip(jax.tree.leaves(fewer), jax.tree.leaves(more), strict=True):
            np.testing.assert_array_equal(one[:whole], other[:whole])
            np.testing.assert_allclose(one, other[:count], rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_devices_share_the_runs_bit_for_bit():
    # In a process of its own: the number of host devices is fixed when JAX is first used.
    program = """
import jax
jax.config.update("jax_num_cpu_devices", 3)
import jax.numpy as jnp, numpy as np, jaxpf
from jaxpf.dynamics import LinearGaussian
from jaxpf.likelihoods import Gaussian
from jaxpf.likelihoods import histogram

one = jnp.ones((1, 1, 1))
tracker = jaxpf.Partitioned(
    dynamics=LinearGaussian(transition=0.9 * one, noise=one),
    likelihood=Gaussian(noise=one),
    ordering=jaxpf.ordering.ps([0]),
    initial=jnp.zeros((1, 1)),
    num_particles=40,
)
frames = jnp.asarray(np.random.default_rng(0).normal(size=(7, 1, 1)), jnp.float32)
keys = jax.random.split(jax.random.key(0), 13)
alone, all_ = (
    jaxpf.monte_carlo(tracker, keys, frames, batch_size=4, devices=devices)
    for devices in (jax.devices()[:1], None)
)
assert len(all_.estimate.devices()) == 3
# Chunks of 6 frames and of 1, which are written to the devices that observe them.
chunked = jaxpf.monte_carlo(tracker, keys, iter(np.asarray(frames)), batch_size=4,
                            frames_per_chunk=1)
for results in (all_, chunked):
    jax.tree.map(np.testing.assert_array_equal, alone, results)
print(np.asarray(alone.estimate).shape)

# Results lie where the keys do.
mesh = jax.make_mesh((3,), ("own",), axis_types=(jax.sharding.AxisType.Auto,))
lying = jax.device_put(keys[:12], jax.NamedSharding(mesh, jax.P("own")))
assert jaxpf.monte_carlo(tracker, lying, frames).log_evidence.sharding == lying.sharding

# Tables that stay in their stack; every frame differs.
video = np.random.default_rng(1).integers(0, 256, (4, 30, 40, 3), np.uint8)
boxes = np.array([[10.0, 8, 12, 10]])
tracker = jaxpf.boxes.tracker(
    video[0], boxes, method="ps", likelihood="integral", noise_pixels=(2, 2, 0.01),
    num_particles=30,
)
alone, all_ = (
    jaxpf.monte_carlo(tracker, keys[:6], video, batch_size=2, devices=devices)
    for devices in (jax.devices()[:1], None)
)
assert np.ptp(np.asarray(alone.log_evidence), axis=1).min() > 0
jax.tree.map(np.testing.assert_array_equal, alone, all_)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "(13, 7, 1, 1)"
