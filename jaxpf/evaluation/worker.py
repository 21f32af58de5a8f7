"""The work of an evaluation: one batch of runs, in this process or another."""

import dataclasses
import hashlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.errors import InputError
from jaxpf.evaluation.batches import Batch
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.trackers import configured_tracker, start_sizes
from jaxpf.running import RUNS_PER_BATCH, monte_carlo


@dataclasses.dataclass(frozen=True)
class Work:
    """A batch that is to be done; everything that another process needs for it.

    Attributes:
        index: of the configuration.
        configuration: what to run.
        first_run: number of the first run.
        num_runs: R.
        width: runs that are computed, padding included: one shape for many batches.
        seed: of the evaluation.
        float64: whether JAX computes in double precision.
        scene: the scene, or a picklable function without arguments that opens it.
        digest: of the scene, which must be the same everywhere.
    """

    index: int
    configuration: Configuration
    first_run: int
    num_runs: int
    width: int
    seed: int
    float64: bool
    scene: Any
    digest: str

    def __str__(self) -> str:
        last = self.first_run + self.num_runs - 1
        return f"{self.configuration.label}, runs {self.first_run} to {last},"


def run_batch(work: Work, attempt: int = 0) -> Batch:
    """Do one batch.

    Args:
        work: what to do.
        attempt: of no effect; it tells a repetition from the first time, where an executor
            takes equal calls for one.

    Raises:
        InputError: the scene cannot be opened here, or is not the one that was planned.
    """
    with jax.enable_x64(work.float64):
        scene, frames = _opened(work)
        tracker = configured_tracker(scene, work.configuration)
        recorded = monte_carlo(
            tracker,
            run_keys(work.seed, work.first_run, work.width),
            frames,
            record=keep_measures,
            batch_size=RUNS_PER_BATCH,
        )
    kept = {
        name: np.asarray(value[: work.num_runs], bool if name == "lost" else np.float32)
        for name, value in recorded.items()
    }
    return Batch(
        seeds=np.full(work.num_runs, work.seed, np.int64),
        runs=np.arange(work.first_run, work.first_run + work.num_runs),
        boxes=_boxes(kept.pop("estimate"), start_sizes(scene)),
        **kept,
    )


def keep_measures(state: Any, summary: Any) -> dict[str, jax.Array]:
    """What an evaluation keeps of a frame."""
    return {
        "estimate": summary.estimate,
        "uniqueness": summary.uniqueness,
        "spread": summary.spread,
        "ess": summary.ess,
        "log_evidence": summary.log_evidence,
        "lost": summary.lost,
    }


def run_keys(seed: int, first_run: int, num_runs: int) -> jax.Array:
    """``[num_runs]`` keys; that of run r is ``fold_in(key(seed), r)``, whatever the batch."""
    numbers = jnp.arange(first_run, first_run + num_runs, dtype=jnp.uint32)
    return jax.vmap(jax.random.fold_in, in_axes=(None, 0))(jax.random.key(seed), numbers)


def imported_batch(boxes: np.ndarray, seed: int) -> Batch:
    """Another tracker's boxes ``[T, P, 4]`` as a batch of one run; all else is unknown."""
    times, objects = boxes.shape[:2]

    def unknown(*shape: int) -> np.ndarray:
        return np.full((1, *shape), np.nan, np.float32)

    return Batch(
        seeds=np.array([seed], np.int64),
        runs=np.array([0], np.int64),
        boxes=boxes[None].astype(np.float32),
        uniqueness=unknown(times, objects),
        spread=unknown(times, objects, 3),
        ess=unknown(times),
        log_evidence=unknown(times),
        lost=~np.isfinite(boxes[None]).all(axis=-1),
    )


def open_scene(scene: Any) -> Any:
    """The scene that a plan means: itself, or what its function returns."""
    return scene() if callable(scene) else scene


def scene_digest(scene: Any) -> str:
    """Tells two scenes apart by their pictures, boxes and patches."""
    digest = hashlib.sha256()
    for array in (scene.frames, scene.boxes, *scene.patches):
        digest.update(f"{array.shape}{array.dtype}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def remember_scene(scene: Any, digest: str) -> None:
    """Spare ``run_batch`` in this process from opening a scene that is open already."""
    _last_scene[:] = [(digest, scene, jnp.asarray(scene.frames[1:]))]


#: The scene that this process worked on last, as (digest, scene, frames on the device).
_last_scene: list[tuple[str, Any, jax.Array]] = []


def _opened(work: Work) -> tuple[Any, jax.Array]:
    known = list(_last_scene)  # another thread may replace it
    if not known or known[0][0] != work.digest:
        scene = open_scene(work.scene)
        found = scene_digest(scene)
        if found != work.digest:
            raise InputError(
                f"scene {scene.name!r} is not the same in every process: its pictures or boxes "
                "differ from those the evaluation began with; give all workers the same files and "
                "the same versions of the libraries that decode them."
            )
        remember_scene(scene, found)
        known = list(_last_scene)
    return known[0][1], known[0][2]


def _boxes(estimate: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """``jaxpf.geometry.boxes_from_substates`` in NumPy: one arithmetic wherever it is done."""
    extent = estimate[..., 2:3] * sizes.astype(np.float32)
    return np.concatenate([estimate[..., :2] - extent / 2, extent], axis=-1)
