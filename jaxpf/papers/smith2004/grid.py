"""Many orderings x sharpness values x runs on many scenes, in one compiled kernel.

All orderings, sharpness values and runs share a frame's histogram table, which is computed once.
Orderings run one after another, because skipping a branch saves time only if all runs in a batch
skip it.  Sharpness values and runs are vectorised together.  Each device processes its own scenes.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, PartitionSpec

from jaxpf.dynamics.gaussian import AR2
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.likelihoods._integral import LANES
from jaxpf.likelihoods.histogram import HistogramLikelihood, histogram_from_patches
from jaxpf.ordering import Ordering
from jaxpf.papers.checkpoints import each
from jaxpf.papers.smith2004.comparison import SMITH2004_PARTICLES, SMITH2004_SCALE
from jaxpf.running import frame_step, init
from jaxpf.shapes.rectangles import boxes_from_substates


class GridResult(NamedTuple):
    """Runs on one scene: O orderings, L sharpness values, R runs, T frames, P objects.

    Attributes:
        boxes: estimated boxes x, y, w, h, ``[O, L, R, T, P, 4]``.
        uniqueness: number of distinct draws divided by N, ``[O, L, R, T, P]``.
        spread: standard deviation of the particle set, ``[O, L, R, T, P, 3]``.
    """

    boxes: np.ndarray
    uniqueness: np.ndarray
    spread: np.ndarray


class Work(NamedTuple):
    """Arrays that one scene's runs need; scenes of equal shape share the kernel.

    Attributes:
        frames: ``[T, H, W, 3]`` uint8, after the start frame.
        initial: ``[P, 3]``, substates before the first frame.
        likelihood: likelihood of the scene's objects.
        keys: ``[R, ...]`` key data, one per run.
    """

    frames: np.ndarray
    initial: np.ndarray
    likelihood: HistogramLikelihood
    keys: np.ndarray


def run_grid(
    scenes: Sequence[Any],
    keys: Sequence[jax.Array],
    orderings: Mapping[str, Ordering],
    sharpness: Sequence[float],
    *,
    num_particles: int = SMITH2004_PARTICLES,
    scale: Sequence[float] = SMITH2004_SCALE,
    resampling: str = "multinomial",
    name: str = "grid",
    wrap: Callable[[Partitioned], Any] | None = None,
) -> Iterator[GridResult]:
    """Track every scene with every ordering and sharpness; yields scene by scene.

    A run's random numbers depend only on its key, which all orderings and sharpness values share.

    Args:
        scenes: scenes of equal shape, see ``scenes.Scene``; the trackers start at the true boxes of
            the first frame and use the scene's patches.
        keys: keys ``[R]`` of the runs for each scene, with equal R.
        orderings: name -> ordering, all of equal shape.
        sharpness: values of lambda.
        num_particles: N.
        scale: noise of u, v (pixels) and of the box's scale.
        resampling: resampling scheme; smith2004 does not name one.
        name: name under which scenes are stored; see ``jaxpf.papers.checkpoints``.
        wrap: optional wrapper of each tracker, with the same likelihood.
    """
    learned = [
        histogram_from_patches(
            scene.patches,
            scene.sizes,
            method="integral",
            num_particles=num_particles,
            frame_shape=scene.frames.shape[1:3],
        )
        for scene in scenes
    ]
    num_bins = max(likelihood.references.shape[-1] for likelihood in learned)
    stacked = jax.tree.map(lambda *rows: jnp.stack(rows), *orderings.values())
    batch = min(jax.local_device_count(), len(scenes))
    settings = stacked, jnp.asarray(sharpness, float), jnp.asarray(scale, float)
    track = partial(_track, settings, (num_particles, resampling, wrap))
    chosen = [range(i, min(i + batch, len(scenes))) for i in range(0, len(scenes), batch)]

    def works(places: Sequence[int]) -> list[Work]:
        works = [_work(scenes[i], with_bins(learned[i], num_bins), keys[i]) for i in places]
        # Pad the last batch: another width would recompile.
        return (works + works[-1:] * batch)[:batch]

    tracked = each(
        (f"{name}-{chunk[0]}-{chunk[-1]}-by-{batch}", partial(track, works(chunk)))
        for chunk in chosen
    )
    for chunk, recorded in zip(chosen, tracked, strict=True):
        for place, i in enumerate(chunk):
            estimate, *others = (np.asarray(recorded[what][place]) for what in _RECORDED)
            boxes = np.asarray(boxes_from_substates(estimate, scenes[i].sizes))
            yield GridResult(boxes, *others)


def _track(settings: Any, static: tuple, works: Sequence[Work]) -> dict[str, Any]:
    """Results of ``_run_scene`` for every work item, by name."""
    # Another process may have fewer devices.
    most = min(jax.local_device_count(), len(works))
    devices = max(n for n in range(1, most + 1) if len(works) % n == 0)
    kernel = _sharded(devices, *static)
    recorded = kernel(jax.tree.map(lambda *rows: np.stack(rows), *works), *settings)
    return dict(zip(_RECORDED, recorded, strict=True))


def _work(scene: Any, likelihood: HistogramLikelihood, keys: jax.Array) -> Work:
    boxes = np.asarray(scene.boxes[0], np.float32)
    initial = np.concatenate(
        [boxes[:, :2] + boxes[:, 2:] / 2, np.ones((len(boxes), 1), np.float32)], axis=1
    )
    return Work(scene.frames[1:], initial, likelihood, np.asarray(jax.random.key_data(keys)))


def with_bins(likelihood: HistogramLikelihood, num_bins: int) -> HistogramLikelihood:
    """The same likelihood with a longer table of bins; the added bins stay empty."""
    references, lookup = likelihood.references, likelihood.bin_lookup
    missing = num_bins - references.shape[-1]
    assert missing % LANES == 0
    return dataclasses.replace(
        likelihood,
        references=jnp.pad(references, ((0, 0), (0, 0), (0, missing))),
        bin_lookup=jnp.where(lookup == references.shape[-1], num_bins, lookup),
    )


@lru_cache
def _sharded(
    num_devices: int, num_particles: int, resampling: str, wrap: Callable | None
) -> Callable:
    """The compiled kernel for scenes distributed over ``num_devices`` devices."""
    run_scene = partial(_run_scene, num_particles=num_particles, resampling=resampling, wrap=wrap)

    def rows(works: Work, *settings: Any) -> Any:
        return lax.map(lambda work: run_scene(work, *settings), works)

    mesh = Mesh(np.array(jax.local_devices()[:num_devices]), ("scene",))
    per_scene, shared = PartitionSpec("scene"), PartitionSpec()
    return jax.jit(
        jax.shard_map(
            rows,
            mesh=mesh,
            in_specs=(per_scene, shared, shared, shared),
            out_specs=per_scene,
            check_vma=False,
        )
    )


def _run_scene(
    work: Work,
    orderings: Ordering,
    sharpness: jax.Array,
    scale: jax.Array,
    *,
    num_particles: int,
    resampling: str,
    wrap: Callable | None,
) -> Any:
    """Results of every frame, leading axes ``[O, L, R, T]``."""
    num_runs, num_values = work.keys.shape[0], sharpness.shape[0]
    keys = jnp.tile(jax.random.wrap_key_data(jnp.asarray(work.keys)), num_values)
    values = jnp.repeat(sharpness, num_runs)

    def tracker(ordering: Ordering, value: Any) -> Any:
        partitioned = Partitioned(
            dynamics=AR2(scale=scale),
            likelihood=dataclasses.replace(work.likelihood, sharpness=value),
            ordering=ordering,
            initial=work.initial,
            num_particles=num_particles,
            resampling=resampling,
        )
        return partitioned if wrap is None else wrap(partitioned)

    def begin(ordering: Ordering) -> Any:
        return jax.vmap(lambda key: init(tracker(ordering, sharpness[0]), key))(keys)

    def of_every_run(advance: Callable, states: Any) -> Any:
        def of_ordering(item: Any) -> Any:
            ordering, states = item

            def of_value(key: Any, value: Any, state: Any) -> Any:
                return advance(tracker(ordering, value), key, state)

            return jax.vmap(of_value)(keys, values, states)

        return lax.map(of_ordering, (orderings, states))

    step_all = frame_step(work.likelihood.observe, of_every_run, _keep)
    times = jnp.arange(work.frames.shape[0])
    _, recorded = lax.scan(step_all, lax.map(begin, orderings), (times, work.frames))

    def arranged(array: jax.Array) -> jax.Array:
        """``[T, O, L * R, ...]`` to ``[O, L, R, T, ...]``."""
        array = jnp.moveaxis(array, 0, 2)
        return array.reshape(array.shape[0], num_values, num_runs, *array.shape[2:])

    return jax.tree.map(arranged, recorded)


#: Recorded fields: the estimate, then those of ``GridResult`` after the boxes.
_RECORDED = ("estimate", "uniqueness", "spread")


def _keep(state: Any, summary: Any) -> Any:
    return tuple(getattr(summary, what) for what in _RECORDED)
