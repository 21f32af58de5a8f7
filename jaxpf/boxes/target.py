"""The box target: upright rectangles of variable size, recognised by colour.

A substate is (u, v, a): centre in pixels and scale relative to the start (smith2004, section 2).
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.boxes.models import (
    DEFAULT_MOMENTUM,
    DEFAULT_SCALE,
    DEFAULT_STEPS,
    LONE_STEPS,
    box_model,
    boxes_at,
    reach_of,
    relative_box_model,
    relative_steps,
)
from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model
from jaxpf.contract.options import OPEN, check_options, plain
from jaxpf.targets.appearance import (
    COLOUR,
    DISCRIMINATIVE,
    NONE,
    PIXELS,
    PRETRAINED,
    RELATIVE,
    appearance_option,
    bands_option,
    check_contrast,
    exclusion_option,
    gain_option,
    likelihood_option,
    momentum_option,
    motion_option,
    naming,
    network_option,
    scale_option,
    sharpness_option,
    steps_option,
)
from jaxpf.targets.target import Looks, Start, Target


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the box model; see the help of each."""

    sharpness: float = sharpness_option(20.0, "likelihood.sharpness")
    scale: tuple[float, ...] = scale_option(DEFAULT_SCALE, tuned=("[0]", "[1]"))
    bands: int = bands_option(2)
    likelihood: str = likelihood_option("auto", "integral", "sampled")
    appearance: str = appearance_option()
    gain: float = gain_option(1.0)
    network: str | None = network_option()
    motion: str = motion_option()
    relative_scale: tuple[float, ...] | None = steps_option(DEFAULT_STEPS, LONE_STEPS)
    momentum: float = momentum_option(DEFAULT_MOMENTUM)
    exclusion: str = exclusion_option()

    def __post_init__(self) -> None:
        check_options(self)


class BoxTarget(Target):
    """Boxes as a target; shapes are boxes x, y, w, h in pixels."""

    name = "boxes"
    options = Options
    coordinates = ("x", "y", "scale")
    has_boxes = True

    def start(self, given: Any, names: Any = None) -> Start:
        """See ``Target``: boxes ``[P, 4]``; default names are numbers from 1."""
        boxes = np.asarray(given, np.float64)
        ids = np.arange(1, len(boxes) + 1) if names is None else np.asarray(names)
        return Start(ids, boxes, boxes[:, 2:], (-1,) * len(boxes))

    def resolved(
        self, options: Options, settings: Mapping[str, Any], num_objects: int | None = None
    ) -> Options:
        """See ``Target``: by default discriminative appearance and relative motion."""
        appearance, motion = options.appearance, options.motion
        if appearance == OPEN:
            appearance = settings.get("appearance", DISCRIMINATIVE)
        if motion == OPEN:
            motion = PIXELS if appearance == COLOUR else RELATIVE
        options = dataclasses.replace(options, appearance=appearance, motion=motion)
        if motion != RELATIVE or num_objects is None:
            return options
        steps = relative_steps(options.relative_scale, num_objects)
        return dataclasses.replace(options, relative_scale=tuple(steps.ravel().tolist()))

    def likelihood(self, options: Options, start: Start, looks: Looks) -> Any:
        """See ``Target``."""
        from jaxpf.likelihoods.histogram import histogram, histogram_from_patches

        if options.appearance == DISCRIMINATIVE:
            return self._discriminative(options, start, looks)
        if options.appearance == PRETRAINED:
            return self._pretrained(options, start, looks)
        settings: dict[str, Any] = {
            "sharpness": options.sharpness,
            "parts": options.bands,
            "method": options.likelihood,
            "num_particles": looks.num_particles,
        }
        with naming([f"the box of object {number}" for number in start.ids]):
            if looks.patches is None:
                check_contrast(looks.frame, start.shapes)
                return histogram(looks.frame, start.shapes, **settings)
            return histogram_from_patches(
                looks.patches, start.sizes, frame_shape=looks.frame_shape, **settings
            )

    def training_likelihood(self, options: Options, start: Start, looks: Looks, frames: Any) -> Any:
        """See ``Target``: bilinear features, as a ratio to those of random background boxes."""
        from jaxpf.likelihoods.histogram import histogram_from_patches

        if len(options.relative_scale or ()) > 3:
            raise InputError(
                f"relative_scale {plain(options.relative_scale)} differs between objects, and "
                "tuning finds one motion for all; give three numbers."
            )
        if options.appearance == PRETRAINED:
            raise InputError(
                "tuning needs derivatives, which appearance pretrained lacks; choose appearance "
                "discriminative or colour."
            )
        if options.appearance == DISCRIMINATIVE:
            settings = {"interpolation": "bilinear", "background_frames": frames}
            return self._discriminative(options, start, looks, **settings)
        return histogram_from_patches(
            looks.patches,
            start.sizes,
            sharpness=options.sharpness,
            parts=options.bands,
            method="integral",
            frame_shape=looks.frame_shape,
            interpolation="bilinear",
            form="ratio",
            background_frames=frames,
        )

    def _discriminative(self, options: Options, start: Start, looks: Looks, **settings: Any) -> Any:
        from jaxpf.likelihoods.discriminative import discriminative, excluding

        with naming([f"the box of object {number}" for number in start.ids]):
            if options.motion == RELATIVE:
                steps = relative_steps(options.relative_scale, len(start.shapes))
                settings["reach"] = reach_of(steps)
            likelihood = discriminative(
                looks.start_frame, start.shapes, gain=options.gain, **settings
            )
            check_contrast(looks.start_frame, start.shapes)
        return likelihood if options.exclusion == NONE else excluding(likelihood)

    def _pretrained(self, options: Options, start: Start, looks: Looks) -> Any:
        from jaxpf.likelihoods.pretrained import efficientnet_lite0, pretrained

        if options.exclusion != NONE:
            raise InputError(
                "exclusion boxes and appearance pretrained do not go together; choose appearance "
                "discriminative, or exclusion none."
            )
        with naming([f"the box of object {number}" for number in start.ids]):
            network = efficientnet_lite0(options.network)
            likelihood = pretrained(
                looks.start_frame, start.shapes, network=network, gain=options.gain
            )
            check_contrast(looks.start_frame, start.shapes)
        return likelihood

    def model(self, options: Options, start: Start, likelihood: Any) -> Model:
        """See ``Target``; substates are (u, v, a)."""
        if options.motion != RELATIVE:
            return box_model(likelihood, start.shapes, options.scale)
        steps = relative_steps(options.relative_scale, len(start.shapes))
        return relative_box_model(likelihood, start.shapes, steps, options.momentum)

    def settled(self, options: Options, start: Start, looks: Looks) -> Options:
        """See ``Target``."""
        options = self.resolved(options, looks.settings)
        if options.appearance != COLOUR or options.likelihood != OPEN:
            return options
        method = self.likelihood(options, start, looks).method
        return dataclasses.replace(options, likelihood=method)

    def shapes(self, start: Start, estimate: Any, tracker: Any) -> np.ndarray:
        """See ``Target``."""
        return boxes_at(estimate, start.sizes)

    def outlines(self, start: Start, shapes: Any) -> Any:
        """See ``Target``."""
        import jax.numpy as jnp

        x, y, w, h = jnp.moveaxis(jnp.asarray(shapes), -1, 0)
        corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
        return jnp.stack([jnp.stack(corner, axis=-1) for corner in corners], axis=-2)

    def measures(self, start: Start, shapes: Any, truth: Any) -> dict[str, Any]:
        """See ``Target``: exact measures for boxes."""
        import jax.numpy as jnp

        from jaxpf.measures import metrics

        return {
            "present": metrics.has_truth(truth),
            "tracked": metrics.track_state(shapes, truth),
            "precision": metrics.precision(shapes, truth),
            "recall": metrics.recall(shapes, truth),
            "overlap": metrics.overlap(shapes, truth),
            "centre_error": metrics.centre_error(shapes, truth),
            "corner_error": jnp.full(jnp.shape(shapes)[:-1], jnp.nan),
        }


BOXES = BoxTarget()
