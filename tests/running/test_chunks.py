"""Frames in chunks: the same bits as all at once, whatever the filter and the frames' source."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from models import partitioned
from records import assert_equal, everything
from refusals import every, message_of

import jaxpf
from jaxpf import ordering
from jaxpf.running import chunks
from jaxpf.running.chunks import chunk_length, in_chunks
from jaxpf.running.frames import frames_of

pytestmark = pytest.mark.compiled_as_by_users

T, P, D = 7, 3, 2
START = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 20.0]], np.float32)
FRAMES = START + np.random.default_rng(0).normal(size=(T, P, D)).astype(np.float32).cumsum(axis=0)
KEYS = jax.random.split(jax.random.key(5), 4)


@jaxpf.pytree_dataclass
class Walk:
    """A tracker of two lines, whose state hangs on every key and frame."""

    start: jax.Array

    def init(self, key):
        return jax.random.normal(key, jnp.shape(self.start))

    def step(self, key, state, frame):
        moved = state + frame * jax.random.normal(key, state.shape)
        return moved, Estimated(moved)


class Estimated(NamedTuple):
    estimate: jax.Array


WALK = Walk(START)
PS = partitioned(ordering.ps([2, 0, 1]), dimension=D, initial=START)


def track(tracker, frames, **given):
    return jaxpf.monte_carlo(tracker, KEYS, frames, everything, batch_size=2, **given)


@pytest.mark.parametrize("tracker", [WALK, pytest.param(PS, marks=pytest.mark.slow)])
def test_states_are_carried_from_chunk_to_chunk_bit_for_bit(tracker):
    """Chunks of 3, 3 and 1 frames: slices of an array, and what a generator gives."""
    whole = track(tracker, FRAMES)
    assert np.ptp(whole[1].estimate[..., 0, 0], axis=0).min() > 0
    for frames in (FRAMES, (frame for frame in FRAMES), jnp.asarray(FRAMES)):
        chunked = track(tracker, frames, frames_per_chunk=3)
        assert all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(chunked))
        assert_equal(whole, chunked)


def test_no_more_frames_are_read_than_two_chunks_hold():
    """While one chunk is read the one before may be computed, but none before that."""
    computed, ahead = [], []

    def frames():
        for number in range(T):
            ahead.append(number - len(computed))
            yield FRAMES[number]

    def count(state, summary):
        jax.debug.callback(lambda _: computed.append(0), summary)
        return summary

    jaxpf.monte_carlo(WALK, KEYS[:1], frames(), count, batch_size=1, frames_per_chunk=2)
    jax.effects_barrier()
    assert max(ahead) < 4
    assert len(computed) == 8  # the last chunk is filled up with a frame that does not count


@pytest.mark.parametrize("source", [iter, lambda frames: {"one": frames, "two": frames[:, 0]}])
@pytest.mark.parametrize(
    ("length", "multiple", "found"),
    [
        (3, 1, [(0, 3, 3), (3, 3, 3), (6, 1, 3)]),
        (1, 3, [(0, 6, 6), (6, 1, 6)]),  # two for each of three devices
        (99, 3, [(0, 7, 9)]),
        (None, 1, [(0, 7, 7)]),
    ],
)
def test_chunks_have_one_length_and_end_with_the_last_frame(source, length, multiple, found):
    chunks = list(in_chunks(frames_of(source(FRAMES)), length, multiple))
    lengths = [len(jax.tree.leaves(chunk)[0]) for _, _, chunk in chunks]
    assert [(*chunk[:2], n) for chunk, n in zip(chunks, lengths, strict=True)] == found
    own = [jax.tree.leaves(chunk)[0][:count] for _, count, chunk in chunks]
    np.testing.assert_array_equal(np.concatenate(own), FRAMES)
    np.testing.assert_array_equal(jax.tree.leaves(chunks[-1][2])[0][-1], FRAMES[-1])


def test_a_chunk_holds_as_much_as_it_may_and_all_hold_nearly_the_same(monkeypatch):
    monkeypatch.setattr(chunks, "CHUNK_BYTES", 99)
    assert chunk_length(None, 10) == 9
    assert chunk_length(20, 10) == 7  # 7, 7 and 6
    assert chunk_length(5, 10) == 5
    assert chunk_length(20, 100) == 2


@every([
    (lambda: track(PS, iter(())), "no frame"),
    (lambda: track(PS, iter([*FRAMES[:3], FRAMES[3, :1]]), frames_per_chunk=3), "frame 3"),
    (lambda: track(PS, FRAMES, frames_per_chunk=0), "frames_per_chunk = 0"),
    (lambda: jaxpf.run(PS, KEYS[0], iter(FRAMES)), "jaxpf.stream"),
])  # fmt: skip
def test_frames_that_make_no_sequence_are_refused(call, named):
    assert named in message_of(call)
