"""Parts: rectangles of fixed size at any angle that hang on one another (gonzales2011).

A part is a partition with substate (x, y, theta, ...): its centre in pixels and its angle in
radians, clockwise in the image.  Options and files count angles in degrees.
"""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.errors import InputError
from jaxpf.models.model import Model
from jaxpf.options import check_options, option
from jaxpf.targets.appearance import (
    bands_option,
    likelihood_option,
    naming,
    scale_option,
    sharpness_option,
    three_values,
)
from jaxpf.targets.target import Looks, Marks, Start, Target

# Samples per side of a part: its likelihood is then off by .017 sharpness, see
# jaxpf.models.likelihoods._sampled.
_SAMPLES = 10
_PATCH_WINDOW = (12, 12)
_DEGREES = np.array([1, 1, math.pi / 180])


def _outlines(poses: Any, sizes: Any) -> Any:
    from jaxpf.models.geometry import corners_from_poses

    return corners_from_poses(poses, sizes)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the model of parts; see the help of each."""

    sharpness: float = sharpness_option(50.0, "likelihood.likelihood.sharpness")
    scale: tuple[float, ...] = scale_option((3.0, 3.0, 3.5))
    joint_scale: tuple[float, ...] = option(
        (0.5, 0.5, 4.5),
        "Of parts, noise of a joint per frame: x and y in pixels, and degrees.",
        least=0,
        path="dynamics.joint_scale",
    )
    bands: int = bands_option(1)
    likelihood: str = likelihood_option("auto", "sampled", "patch")
    dynamics: str = option(
        "relative",
        "Of parts: relative (they follow their parents) or absolute (each moves on its own).",
        choices=("relative", "absolute"),
        compiles=True,
    )

    def __post_init__(self) -> None:
        check_options(self)


class Parts(Target):
    """Parts as a target; shapes are poses x, y (pixels), theta (radians)."""

    name = "parts"
    noun = "part"
    options = Options
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "parts_file": {
            "type": Path,
            "help": "Instead of boxes, the parts of an articulated object: CSV with the header "
            "part,parent,x,y,w,h,angle (x, y the centre, angle in degrees clockwise, no parent: "
            "root).",
        }
    }
    defaults: Mapping[str, Any] = {"method": "sps"}
    outlines_of_estimates = staticmethod(_outlines)

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Target``."""
        from jaxpf.files.parts import read_parts

        path = given["parts_file"]
        if path is None:
            raise InputError("no parts: give --parts-file FILE.csv.")
        parts = read_parts(path)
        for name, (x, y, _) in zip(parts.names, parts.poses, strict=True):
            if not (0 <= x < source.width and 0 <= y < source.height):
                raise InputError(
                    f"part '{name}' of '{path}' has its centre ({x:g},{y:g}) outside the "
                    f"{source.width}x{source.height} frame; give x and y of the centre, in pixels."
                )
        return Start(np.array(parts.names), parts.poses, parts.sizes, parts.parents)

    def fits_scene(self, scene: Any) -> bool:
        """Scenes of parts tell poses and who hangs on whom."""
        return {"poses", "parents"} <= set(scene.extras)

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Target``."""
        return np.asarray(scene.extras["poses"], np.float64)

    def scene_start(self, scene: Any) -> Start:
        """See ``Target``."""
        parents = tuple(int(parent) for parent in scene.extras["parents"])
        poses = np.asarray(scene.extras["poses"][0], np.float64)
        ids = np.asarray(scene.extras.get("ids", np.arange(1, len(parents) + 1)))
        return Start(ids, poses, np.asarray(scene.sizes, np.float64), parents)

    def model(self, options: Options, start: Start, looks: Looks) -> Model:
        """See ``Target``."""
        from jaxpf.models.likelihoods import patch, patch_from_pictures

        if options.likelihood != "patch":
            return self._model(self._histogram(options, start, looks), options, start)
        settings: dict[str, Any] = {
            "sigma": 1 / math.sqrt(options.sharpness),
            "window": _PATCH_WINDOW,
        }
        with naming([f"part '{name}'" for name in start.ids]):
            if looks.patches is None:
                likelihood = patch(looks.frame, start.shapes, start.sizes, **settings)
            else:
                likelihood = patch_from_pictures(looks.patches, start.sizes, **settings)
        return self._model(likelihood, options, start)

    def training_model(self, options: Options, start: Start, looks: Looks, frames: Any) -> Model:
        """See ``Target``: bilinear histograms, weighed against those of boxes anywhere."""
        likelihood = self._histogram(
            options, start, looks,
            interpolation="bilinear", form="ratio", background_frames=frames,
        )  # fmt: skip
        model = self._model(likelihood, options, start)
        # Three numbers for all parts, as the options have them, instead of three for each.
        noise = {"scale": np.asarray(_DEGREES * options.scale, np.float32)}
        if options.dynamics == "relative":
            noise["joint_scale"] = np.asarray(_DEGREES * options.joint_scale, np.float32)
        return model._replace(dynamics=dataclasses.replace(model.dynamics, **noise))

    def _histogram(self, options: Options, start: Start, looks: Looks, **settings: Any) -> Any:
        from jaxpf.models.likelihoods import histogram_from_patches
        from jaxpf.targets.articulated import cut_pictures

        pictures = looks.patches
        if pictures is None:
            pictures = cut_pictures(looks.frame, start.shapes, start.sizes)
        with naming([f"part '{name}'" for name in start.ids]):
            return histogram_from_patches(
                pictures,
                start.sizes,
                sharpness=options.sharpness,
                parts=options.bands,
                method="sampled",
                samples=max(_SAMPLES, 2 * options.bands),
                **settings,
            )

    def _model(self, likelihood: Any, options: Options, start: Start) -> Model:
        from jaxpf.targets.articulated import parts_model

        return parts_model(
            likelihood,
            start.shapes,
            start.sizes,
            start.parents,
            dynamics=options.dynamics,
            scale=_DEGREES * options.scale,
            joint_scale=_DEGREES * options.joint_scale,
        )

    def settled(self, options: Options, start: Start, looks: Looks) -> Options:
        """See ``Target``."""
        if options.likelihood != "auto":
            return options
        return dataclasses.replace(options, likelihood="sampled")

    def tuned_by_default(self, options: Options) -> tuple[str, ...]:
        """See ``Target``."""
        return "likelihood.likelihood.sharpness", "dynamics.scale", "dynamics.joint_scale[2]"

    def noise(self, options: Options, start: Start) -> np.ndarray:
        """See ``Target``: of parts that move each on their own; joints have no noise in x, y."""
        if options.dynamics == "absolute":
            return _DEGREES * options.scale
        return np.full(3, np.nan)

    def tuned(self, options: Options, values: Mapping[str, Any]) -> Options:
        """See ``Target``."""
        for path, value in values.items():
            name = path.partition("[")[0]
            if path == "likelihood.likelihood.sharpness":
                options = dataclasses.replace(options, sharpness=float(value))
                continue
            found = {"dynamics.scale": "scale", "dynamics.joint_scale": "joint_scale"}.get(name)
            if found is None:
                raise InputError(f"a model of parts has no {path}; apply the result to a tracker.")
            radians = _DEGREES * getattr(options, found)
            three = np.array(three_values(radians, path, value)) / _DEGREES
            changed: dict[str, Any] = {found: tuple(three.tolist())}
            options = dataclasses.replace(options, **changed)
        return options

    def positions(self, start: Start, shapes: Any) -> Any:
        """See ``Target``."""
        return shapes

    def shapes(self, start: Start, estimate: Any) -> np.ndarray:
        """See ``Target``."""
        return np.asarray(estimate)[..., :3]

    def outlines(self, start: Start, shapes: Any) -> Any:
        """See ``Target``."""
        return _outlines(shapes, start.sizes)

    def scaled(
        self, start: Start, shapes: np.ndarray, factors: tuple[float, float]
    ) -> tuple[Start, np.ndarray]:
        """See ``Target``."""
        sizes = start.sizes * np.sqrt(np.prod(factors))
        return dataclasses.replace(start, sizes=sizes), shapes * np.array([*factors, 1.0])

    def track_writer(self, path: Any, start: Start) -> Any:
        """See ``Target``: CSV with the header ``frame,part,x,y,w,h,angle``."""
        return _PartWriter(path, start)

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Target``."""
        from jaxpf.media.overlay import draw_rectangles

        corners = np.asarray(self.outlines(start, np.asarray(shapes)), float)
        return draw_rectangles(frame, corners, list(start.ids), marks.colours, marks.lost)


PARTS = Parts()


class _PartWriter:
    """Poses of one run, frame by frame."""

    def __init__(self, path: Any, start: Start):
        from jaxpf.files.parts import PartTrackWriter

        self._start, self._writer = start, PartTrackWriter(path)

    def __enter__(self) -> "_PartWriter":
        self._writer.__enter__()
        return self

    def __exit__(self, *exception: Any) -> Any:
        return self._writer.__exit__(*exception)

    def append(self, frame: int, shapes: Any, lost: Any) -> None:
        self._writer.append(frame, self._start.ids, shapes, self._start.sizes)
