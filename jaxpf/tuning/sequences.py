"""Scenes made ready for tuning, and for the comparison afterwards."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.errors import InputError
from jaxpf.evaluation.trackers import scene_tracker, start_sizes
from jaxpf.models.geometry import substates_from_boxes
from jaxpf.models.likelihoods import histogram_from_patches
from jaxpf.targets.boxes import box_tracker, ordering_of
from jaxpf.tuning.comparison import HeldOut
from jaxpf.tuning.problem import TrainingSequence

#: Frames of a sequence from which the background is learned.
_BACKGROUND_FRAMES = 3


@dataclasses.dataclass(frozen=True)
class BoxModel:
    """What a tracker of boxes is made of, tuned values included.

    Attributes:
        method: of ``jaxpf.boxes.METHODS``.
        sharpness: of the likelihood.
        scale: noise of u, v (pixels) and of the relative size.
        particles: N.
        resampling: of ``jaxpf.resampling.SCHEMES``.
        parts: horizontal bands of a box.
        gradient: through resampling, see ``jaxpf.gradients``.
    """

    method: str = "dps"
    sharpness: float = 20.0
    scale: tuple[float, ...] = (4.0, 2.0, 0.003)
    particles: int = 100
    resampling: str = "systematic"
    parts: int = 2
    gradient: str = "stop_gradient"

    def with_values(self, values: Mapping[str, Any]) -> "BoxModel":
        """The model with tuned values of the sharpness and the motion noise, by their paths."""
        scale, sharpness = np.array(self.scale, float), self.sharpness
        for path, value in values.items():
            name, _, index = path.partition("[")
            if name == "likelihood.sharpness":
                sharpness = float(value)
            elif name != "dynamics.scale":
                raise InputError(f"a model of boxes has no {path}; apply the result to a tracker.")
            elif index:
                scale[int(index.rstrip("]"))] = float(value)
            else:
                scale = np.asarray(value, float)
        return dataclasses.replace(self, sharpness=sharpness, scale=tuple(scale.tolist()))


def training_sequence(
    scene: Any, model: BoxModel, objective: Any, labels: int | None = None
) -> TrainingSequence:
    """A scene with a tracker that is differentiable in parameters and state.

    Its histograms are bilinear, and their distance is weighed against that of boxes anywhere in
    some frames (``form="ratio"``), which leaves the weights as they are: values found go
    with any other tracker of boxes.

    Args:
        scene: see ``scenes.Scene``; trackers start in its first frame.
        model: with the values to start from.
        objective: see ``tune``.
        labels: how many frames keep their truth, evenly spread, the last one included; default
            all.

    Raises:
        InputError: an argument is out of range.
    """
    likelihood = histogram_from_patches(
        scene.patches,
        start_sizes(scene),
        sharpness=model.sharpness,
        parts=model.parts,
        method="integral",
        frame_shape=scene.frames.shape[1:3],
        interpolation="bilinear",
        form="ratio",
        background_frames=scene.frames[_spread(len(scene.frames), _BACKGROUND_FRAMES)],
    )
    tracker = box_tracker(
        likelihood,
        scene.boxes[0],
        ordering_of(model.method, scene.boxes.shape[1]),
        scale=model.scale,
        num_particles=model.particles,
        resampling=model.resampling,
    )
    tracker = dataclasses.replace(tracker, gradient=model.gradient)
    boxes = np.array(scene.boxes[1:], np.float32)
    if labels is not None:
        if not 1 <= labels <= len(boxes):
            raise InputError(
                f"labels = {labels} must be 1 to {len(boxes)}, the frames of {scene.name!r} after "
                "its first."
            )
        kept = len(boxes) - 1 - _spread(len(boxes), labels)
        boxes[np.setdiff1d(np.arange(len(boxes)), kept)] = np.nan
    truth: Any = boxes
    if objective == "position":
        truth = np.asarray(substates_from_boxes(boxes, start_sizes(scene)))
    return TrainingSequence(
        tracker=tracker,
        frames=np.asarray(scene.frames[1:]),
        truth=None if objective == "evidence" else truth,
        sizes=start_sizes(scene).astype(np.float32),
        name=scene.name,
    )


def held_out(scene: Any, before: BoxModel, after: BoxModel, runs: int) -> HeldOut:
    """A scene with the trackers that ``jaxpf evaluate`` would run on it."""

    def tracker(model: BoxModel) -> Any:
        return scene_tracker(
            scene,
            ordering_of(model.method, scene.boxes.shape[1]),
            sharpness=model.sharpness,
            num_particles=model.particles,
            scale=model.scale,
            resampling=model.resampling,
            parts=model.parts,
            num_runs=runs,
        )

    return HeldOut(
        before=tracker(before),
        after=tracker(after),
        frames=np.asarray(scene.frames[1:]),
        truth=np.asarray(scene.boxes[1:], np.float64),
        sizes=start_sizes(scene),
    )


def _spread(count: int, wanted: int) -> np.ndarray:
    """At most ``wanted`` of the numbers below ``count``, evenly spread, 0 included."""
    return np.unique(np.rint(np.linspace(0, count - 1, min(wanted, count))).astype(int))
