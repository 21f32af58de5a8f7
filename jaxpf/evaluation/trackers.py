"""Trackers for scenes: boxes that start at the truth and know their objects' colours."""

from typing import Any

import numpy as np

from jaxpf.evaluation.plan import order_of_label
from jaxpf.evaluation.results import Configuration
from jaxpf.filters.partitioned.ordering import Ordering
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.models.likelihoods.histogram import HistogramLikelihood, histogram_from_patches
from jaxpf.running import RUNS_PER_BATCH
from jaxpf.targets.boxes import DEFAULT_SCALE, box_tracker, ordering_of


def scene_tracker(
    scene: Any,
    ordering: Ordering,
    *,
    sharpness: float = 20.0,
    num_particles: int = 300,
    scale: tuple[float, ...] = DEFAULT_SCALE,
    resampling: str = "systematic",
    parts: int = 2,
    likelihood: str = "auto",
    num_runs: int = 1,
) -> Partitioned:
    """A box tracker that starts at the scene's first true boxes and knows its patches.

    Args:
        scene: see ``scenes.Scene``; every object must have a box in its first frame.
        ordering: see ``jaxpf.ordering``.
        sharpness: of the likelihood.
        num_particles: N.
        scale: see ``jaxpf.boxes.box_tracker``.
        resampling: see ``jaxpf.boxes.box_tracker``.
        parts: horizontal bands of a box.
        likelihood: how histograms are computed; "auto" is the cheaper way for ``num_runs``.
        num_runs: runs that share a frame's work, for "auto".

    Raises:
        InputError: an argument is out of range; the sentence says which.
    """
    model = scene_likelihood(
        scene,
        sharpness=sharpness,
        num_particles=num_particles,
        parts=parts,
        likelihood=likelihood,
        num_runs=num_runs,
    )
    return box_tracker(
        model,
        scene.boxes[0],
        ordering,
        scale=scale,
        num_particles=num_particles,
        resampling=resampling,
    )


def scene_likelihood(
    scene: Any,
    *,
    sharpness: float,
    num_particles: int,
    parts: int,
    likelihood: str,
    num_runs: int = RUNS_PER_BATCH,
) -> HistogramLikelihood:
    """The colours of a scene's reference patches; arguments as for ``scene_tracker``."""
    return histogram_from_patches(
        scene.patches,
        start_sizes(scene),
        sharpness=sharpness,
        parts=parts,
        method=likelihood,
        frame_shape=scene.frames.shape[1:3],
        num_particles=num_particles,
        num_runs=num_runs,
    )


def start_sizes(scene: Any) -> np.ndarray:
    """``[P, 2]``: width and height at scale 1, those of the first true boxes.

    A patch is smaller where its box reaches beyond the picture.
    """
    return np.asarray(scene.boxes[0][:, 2:])


def configured_tracker(scene: Any, configuration: Configuration) -> Partitioned:
    """The tracker of one configuration of an evaluation."""
    parameters: dict[str, Any] = dict(configuration.parameters)
    method = configuration.method.lower()
    ordering = ordering_of(
        method,
        scene.boxes.shape[1],
        order=order_of_label(configuration.ordering) if method == "ps" else None,
        swap=configuration.ordering if method == "sps" else "combinatorial",
    )
    return scene_tracker(
        scene,
        ordering,
        sharpness=parameters["sharpness"],
        num_particles=parameters["particles"],
        scale=tuple(float(value) for value in parameters["scale"].split(",")),
        resampling=parameters["resampling"],
        parts=parameters["parts"],
        likelihood=parameters["likelihood"],
    )
