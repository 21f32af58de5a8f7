"""Runs one batch of an evaluation, in this process or another."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.calls import model_error
from jaxpf.contract.state import Summary
from jaxpf.evaluation.results import BUILT_IN, Batch, Configuration
from jaxpf.evaluation.trackers import tracker_of
from jaxpf.running.blocks import Blocks, run_blocks
from jaxpf.targets import find_target
from jaxpf.targets.building import shapes_of
from scenes import Scene


@dataclasses.dataclass(frozen=True)
class Work:
    """A batch to run, with everything that another process needs.

    Attributes:
        index: of the configuration.
        configuration: to run.
        first_run: number of the first run.
        num_runs: R.
        blocks: vectorised blocks of runs, padded so that many batches share one shape.
        seed: of the evaluation.
        float64: whether JAX computes in double precision.
        open_scene: picklable function without arguments that returns the scene, the same in
            every process.
        target: name of the target, the type of the scene's objects.
        function: for a user-defined tracker, the function of the scene that makes it.
    """

    index: int
    configuration: Configuration
    first_run: int
    num_runs: int
    blocks: Blocks
    seed: int
    float64: bool
    open_scene: Callable[[], Scene]
    target: str
    function: Callable[[Any], Any] | None = None


def run_batch(work: Work) -> dict[str, np.ndarray]:
    """Run one batch; returns the fields of a ``Batch``.

    Raises:
        InputError: the scene cannot be opened in this process, or differs from the planned one.
    """
    with jax.enable_x64(work.float64):
        scene, target = work.open_scene(), find_target(work.target)
        start, tracker = target.scene_start(scene), _tracker(scene, work)
        error = model_error(tracker, start.num_partitions).astype(np.float32)
        recorded = run_blocks(
            tracker,
            run_keys(work.seed, work.first_run, work.num_runs),
            scene.frames[1:],
            work.blocks,
            record=keep_measures,
        )
    kept = {
        name: np.asarray(value, bool if name == "without_likelihood" else np.float32)
        for name, value in recorded.items()
    }
    return {
        "seeds": np.full(work.num_runs, work.seed, np.int64),
        "runs": np.arange(work.first_run, work.first_run + work.num_runs),
        "shapes": shapes_of(tracker, target, start, kept.pop("estimate")).astype(np.float32),
        "model_error": np.broadcast_to(error, (work.num_runs, *error.shape)),
        **kept,
    }


def keep_measures(state: object, summary: Summary) -> dict[str, jax.Array]:
    """Select the values of a frame to store; values missing from a user's summary are NaN."""
    estimate = summary.estimate

    def or_nan(name: str, *shape: int) -> jax.Array:
        value = getattr(summary, name, None)
        return jnp.full(shape, jnp.nan, estimate.dtype) if value is None else value

    hopeless = getattr(summary, "without_likelihood", None)
    return {
        "estimate": estimate,
        "distinct_share": or_nan("distinct_share", *estimate.shape[:-1]),
        "spread": or_nan("spread", *estimate.shape),
        "confidence": or_nan("confidence", *estimate.shape[:-1]),
        "ess": or_nan("ess"),
        "log_evidence": or_nan("log_evidence"),
        "without_likelihood": (
            ~jnp.isfinite(estimate).all(axis=-1) if hopeless is None else hopeless
        ),
    }


def run_keys(seed: int, first_run: int, num_runs: int) -> jax.Array:
    """Keys ``[num_runs]``; run r has ``fold_in(key(seed), r)`` regardless of its batch."""
    numbers = jnp.arange(first_run, first_run + num_runs, dtype=jnp.uint32)
    return jax.vmap(jax.random.fold_in, in_axes=(None, 0))(jax.random.key(seed), numbers)


def imported_batch(shapes: np.ndarray, seed: int) -> Batch:
    """Another tracker's shapes ``[T, P, S]`` as a batch of one run; other measures are NaN."""
    times, objects = shapes.shape[:2]

    def unknown(*shape: int) -> np.ndarray:
        return np.full((1, *shape), np.nan, np.float32)

    return Batch(
        seeds=np.array([seed], np.int64),
        runs=np.array([0], np.int64),
        shapes=shapes[None].astype(np.float32),
        distinct_share=unknown(times, objects),
        spread=unknown(times, objects, 3),
        model_error=np.zeros((1, objects, 3), np.float32),
        confidence=unknown(times, objects),
        ess=unknown(times),
        log_evidence=unknown(times),
        without_likelihood=~np.isfinite(shapes[None]).all(axis=-1),
    )


def _tracker(scene: Scene, work: Work) -> Any:
    """Make the tracker; a user's function is called once per scene and its tracker reused."""
    if work.configuration.kind == BUILT_IN:
        return tracker_of(scene, find_target(work.target), work.configuration)
    key = id(scene), work.configuration.method
    if _own_tracker.get("key") != key:
        tracker = tracker_of(scene, find_target(work.target), work.configuration, work.function)
        _own_tracker.update(key=key, tracker=tracker, scene=scene)
    return _own_tracker["tracker"]


#: The last user-defined tracker made in this process, with its scene and its key.
_own_tracker: dict[str, Any] = {}
