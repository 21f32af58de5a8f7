"""One run over the frames of a sequence: all in one loop, frame by frame, and ahead of them."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxpf.contract import calls
from jaxpf.contract.calls import at_frame, observe_nearby, with_inputs
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import T
from jaxpf.contract.recognised import recognised
from jaxpf.contract.types import TrackerLike
from jaxpf.lowering.programs import compiled
from jaxpf.running import missing_frames
from jaxpf.running.frames import as_arrays, frames_of, noted, num_frames, warn_of_frames

_ENDED = object()


class TrackedFrame(NamedTuple):
    """One tracked frame of a video or a time series, in NumPy arrays.

    Attributes:
        time: number of the frame among those tracked, from 0.
        frame: the input frame.
        state: the tracker's state, still on the device.
        summary: the frame's summary.
    """

    time: int
    frame: np.ndarray
    state: Any
    summary: Any


def summary_only(state: object, summary: Any) -> Any:
    """Record each frame's summary; the default of ``record``."""
    return summary


def run(
    tracker: TrackerLike,
    key: jax.Array,
    frames: Any,
    record: Callable[[Any, Any], Any] = summary_only,
    observed: Any = None,
    state: Any = None,
    inputs: Any = None,
) -> tuple[Any, Any]:
    """Run a filter once over a sequence of frames or observations.

    The first call for a kind of tracker and a shape of frames compiles silently, for seconds or,
    with many objects, minutes.  ``jax.config.update("jax_log_compiles", True)`` logs compilation;
    ``jaxpf.stream`` yields every frame's summary as it is computed.

    To resume a run, pass its key, its final state and the frames that follow; the results are
    identical to an uninterrupted run.  ``jaxpf.save`` stores a state on disk.

    Example::

        state, summary = jaxpf.run(tracker, jax.random.key(0), y)
        summary.estimate, summary.spread  # [T, P, D] each

    Args:
        tracker: any object with ``init`` and ``step``, registered as a pytree.
        key: the run's random key; frame t uses ``fold_in(key, t + 1)``.
        frames: array or pytree with a leading time axis ``[T, ...]``; also a pandas Series or
            DataFrame.  Masked entries and ``<NA>`` mean the same as NaN.
        record: function of ``(state, summary)`` that returns what to keep of each frame.  A new
            function recompiles, unless it has the same code and values
            (``jaxpf.contract.recognised``).
        observed: ``[T]`` bool, false for a missing frame, in which particles move by their dynamics
            alone; or ``[T, P]``, false for a missing partition, such as a landmark out of view; or
            of the shape of ``frames``, false for a missing component, with a likelihood that
            handles NaN, such as ``jaxpf.likelihoods.Gaussian``.  By default, float frames that are
            entirely NaN are missing.  The log-evidence increment of a missing frame is 0, unless it
            is random (``jaxpf.running.missing_frames``).
        state: state after the previous frames, to resume; None starts with ``tracker.init``.
            It must have a field ``time``, see ``jaxpf.contract.Tracker``.
        inputs: known inputs of these frames, a pytree of arrays ``[T, ...]``; functions of
            ``jaxpf.state_space`` receive a frame's row as ``u``.

    Returns:
        The final state, and the recorded values with a leading axis T.  A frame that no particle
        explains is skipped: ``log_evidence`` is -inf, ``ess`` 0, and ``status`` has
        ``STATUS_IMPOSSIBLE``; a warning names the first such frame.

    Raises:
        InputError: no frames, arrays with different numbers of frames, or an iterable of single
            frames; ``observed`` of a wrong shape; a frame that is NaN in part.
    """
    frames = frames_of(frames).stacked()
    first: Any = 0 if state is None else calls.time_of(state)
    tracker, taken = ready(tracker, frames, observed, inputs, first)
    with noted(tracker):
        state, recorded = run_compiled(tracker, as_key(key), taken, recognised(record), state)
    warn_of_frames(recorded, lambda time: jax.tree.map(lambda x: x[time], frames), first)
    return state, recorded


def stream(
    tracker: TrackerLike,
    key: jax.Array,
    frames: Iterable[np.ndarray],
    observed: Iterable[bool] | None = None,
    state: Any = None,
    inputs: Any = None,
) -> Iterator[TrackedFrame]:
    """Track frames as they come, with the same results as ``jaxpf.run`` with the same key.

    For online filtering of any series: observations ``y`` of a state-space model, pictures of a
    camera.  Frames are not kept, so memory does not grow with the length of the sequence.

    Example::

        for tracked in jaxpf.stream(tracker, jax.random.key(0), y):
            print(tracked.time, tracked.summary.estimate)

    Args:
        tracker: any tracker.
        key: the run's random key.
        frames: an iterable of single frames, or ``[T, ...]``; each as the tracker's likelihood
            takes it, such as a number, a vector or a uint8 RGB picture ``[H, W, 3]``, all of the
            same shape.
        observed: whether each frame was seen, as for ``jaxpf.run``; a dropped frame may hold any
            values of that size.
        state: state after the previous frames, to resume, as for ``jaxpf.run``; frames are
            numbered from its ``time``.
        inputs: known inputs of these frames as for ``jaxpf.run``, or an iterable of each frame's.

    Yields:
        A ``TrackedFrame`` for each frame: ``time``, ``frame``, ``state`` and ``summary``.
    """
    key = as_key(key)
    first = 0 if state is None else int(calls.time_of(state))
    with noted(tracker):
        state = init_compiled(tracker, key) if state is None else state
    seen, given = (
        itertools.repeat(None) if rows is None else frames_of(rows).one_by_one()
        for rows in (observed, inputs)
    )
    told = 0
    for number, frame in enumerate(frames_of(frames).one_by_one(), first):
        if frame is None:
            raise InputError(f"frame {number} is None, as an unreadable file gives; give arrays.")
        rows = {"observed": next(seen, _ENDED), "inputs": next(given, _ENDED)}
        for name, row in rows.items():
            if row is _ENDED:
                raise InputError(f"{name} end before frame {number}; give a row for each frame.")
        one, is_seen, row = jax.tree.map(lambda x: np.asarray(x)[None], (frame, *rows.values()))
        its_tracker = with_rows(tracker, row, 1, number)
        its_tracker, one = missing_frames.marked(its_tracker, one, is_seen, number)
        taken = jax.tree.map(lambda x: x[0], one)
        with noted(tracker):
            state, summary = step(its_tracker, key, number, state, taken)
        summary = jax.tree.map(np.asarray, summary)
        told = warn_of_frames(summary, [frame].__getitem__, number, told)
        yield TrackedFrame(number, frame, state, summary)
    if observed is not None and next(seen, _ENDED) is not _ENDED:
        raise InputError("observed has more rows than there are frames; give a row for each frame.")


def forecast(
    tracker: TrackerLike,
    key: jax.Array,
    state: Any,
    steps: int,
    record: Callable[[Any, Any], Any] = summary_only,
    inputs: Any = None,
) -> tuple[Any, Any]:
    """Predict targets after the last frame: ``run`` over missing frames.

    Particles move by their dynamics alone; ``summary.spread`` shows the growing uncertainty.
    ``jaxpf.simulate(tracker, key, steps, state=state, num_draws=1000)`` draws observations too.

    Example::

        state, _ = jaxpf.run(tracker, key, y)
        _, ahead = jaxpf.forecast(tracker, key, state, 30)

    Args:
        tracker: the tracker of the previous frames.
        key: with the run's key, the forecast continues exactly as ``run`` would.
        state: state after the last frame, with its ``time``, see ``jaxpf.contract.Tracker``.
        steps: S, number of frames to predict.
        record: as for ``run``.
        inputs: of these S frames, as for ``run``.

    Returns:
        The state S frames ahead, and the recorded values with a leading axis S.

    Raises:
        InputError: fewer than one step, or a model with inputs that are not given for each step.
    """
    check_whole("steps", steps)
    nothing = np.zeros(steps, bool)
    tracker = with_rows(tracker, inputs, steps, calls.time_of(state))
    blind = missing_frames.WithoutFrames(tracker)
    with noted(tracker):
        return run_compiled(blind, as_key(key), (nothing, nothing), recognised(record), state)


def ready(
    tracker: TrackerLike,
    frames: Any,
    observed: Any = None,
    inputs: Any = None,
    first: ArrayLike = 0,
) -> tuple[Any, Any]:
    """Let a tracker know the inputs of all frames, and which are missing.

    Arguments and errors are those of ``run``; returns the tracker, and the frames as its steps take
    them.
    """
    frames = frames_of(frames).stacked()
    tracker = with_rows(tracker, inputs, num_frames(frames), first)
    return missing_frames.marked(tracker, frames, observed)


def with_rows(tracker: T, inputs: Any, count: int, first: ArrayLike = 0) -> T:
    """Return the tracker with the inputs of ``count`` frames; refuse another number of rows."""
    if inputs is None:
        return tracker
    inputs = as_arrays(inputs)
    for path, leaf in jax.tree_util.tree_leaves_with_path(inputs):
        if np.shape(leaf)[:1] != (count,):
            raise InputError(
                f"inputs{jax.tree_util.keystr(path)} has shape {list(np.shape(leaf))} for {count} "
                f"frames; give a row for each, [{count}, ...]."
            )
    return with_inputs(tracker, inputs, first)


def frame_key(key: jax.Array, time: ArrayLike) -> jax.Array:
    """Return the key of frame ``time`` (from 0) of a run; index 0 is reserved for ``init``."""
    return jax.random.fold_in(key, time + 1)


def init(tracker: TrackerLike, key: jax.Array) -> Any:
    """Return a run's initial state, as in ``run``."""
    return tracker.init(jax.random.fold_in(key, 0))


init_compiled = compiled(init)


def as_key(key: jax.Array) -> jax.Array:
    """Convert a typed or legacy key, or several, to typed ones."""
    return jax.random.wrap_key_data(jnp.asarray(key)) if key.dtype == np.uint32 else key


def frame_step(
    observe: Callable[[Any], Any],
    of_every_run: Callable[[Callable, Any], Any],
    record: Callable[[Any, Any], Any],
) -> Callable[[Any, Any], Any]:
    """Build the body of a loop over frames: observe a frame once, and advance all runs.

    ``of_every_run(advance, states)`` applies ``advance(tracker, key, state)`` to every run, in any
    arrangement of the states, and returns the new states and the recorded values.  The result is a
    ``lax.scan`` body: a function of ``states`` and ``(time, frame)`` that returns the same.
    """

    def step_all(states: Any, item: Any) -> Any:
        time, frame = item
        observation = observe(frame)

        def advance(tracker: TrackerLike, key: jax.Array, state: Any) -> Any:
            step = calls.observed_apart(at_frame(tracker, time))[1]
            state, summary = step(frame_key(key, time), state, observation)
            return state, record(state, summary)

        return of_every_run(advance, states)

    return step_all


def one_run(tracker: TrackerLike, key: jax.Array, record: Callable[[Any, Any], Any]) -> Callable:
    """Return the ``frame_step`` of a single run.

    If the tracker can observe only what is near its estimates, each frame is first tried so, and
    repeated whole if that does not show every particle.  Under ``vmap`` both are computed.
    """
    observe = calls.observed_apart(tracker)[0]
    step_whole = frame_step(observe, lambda advance, state: advance(tracker, key, state), record)

    def step_one(state: Any, item: Any) -> Any:
        time, frame = item
        observation = observe_nearby(tracker, frame, state)
        if observation is None:
            return step_whole(state, item)
        step = calls.observed_apart(at_frame(tracker, time))[1]
        new, summary = step(frame_key(key, time), state, observation)
        return lax.cond(
            summary.num_invalid == 0,
            lambda: (new, record(new, summary)),
            lambda: step_whole(state, item),
        )

    return step_one


def together(tracker: TrackerLike, keys: jax.Array) -> Callable[[Callable, Any], Any]:
    """Return ``of_every_run`` for vectorised runs of one tracker, with keys and states ``[R]``."""

    def of_every_run(advance: Callable, states: Any) -> Any:
        return jax.vmap(partial(advance, tracker))(keys, states)

    return of_every_run


@partial(compiled, static_argnames="record")
def run_compiled(
    tracker: TrackerLike, key: jax.Array, frames: Any, record: Callable, state: Any = None
) -> Any:
    """``run`` without its checks."""
    first = 0 if state is None else state.time
    times = first + jnp.arange(num_frames(frames))
    state = init(tracker, key) if state is None else state
    return lax.scan(one_run(tracker, key, record), state, (times, frames))


@compiled
def step(tracker: TrackerLike, key: jax.Array, time: int, state: Any, frame: np.ndarray) -> Any:
    """Return state and summary of frame ``time`` (from 0) of a run, as in ``stream``."""
    return one_run(tracker, key, summary_only)(state, (time, frame))
