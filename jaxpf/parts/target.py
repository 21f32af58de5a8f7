"""The part target: rectangles of fixed size at any angle, connected by joints (gonzales2011).

Several objects form a forest with one root each.

A part is a partition with substate (x, y, theta, ...): its centre in pixels and its angle in
radians, clockwise in the image.  Options and files use degrees.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import Argument, InputError, check_names, check_type
from jaxpf.contract.model import Model, check_tree
from jaxpf.contract.names import PART_DYNAMICS
from jaxpf.contract.numbers import numbers_in
from jaxpf.contract.options import check_options, option
from jaxpf.parts.data import Parts
from jaxpf.parts.files import read_parts
from jaxpf.targets.appearance import (
    bands_option,
    likelihood_option,
    noise_pixels_option,
    sharpness_option,
    slip_option,
)
from jaxpf.targets.later import check_inside
from jaxpf.targets.target import Looks, Marks, Start, Target

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.media.frame_source import FrameSource
    from scenes import Scene

# Samples per side of a part: the error of the likelihood is then .017 sharpness, see
# jaxpf.likelihoods._sampled.
_SAMPLES = 10
_PATCH_WINDOW = (12, 12)
#: Default slip of filmed parts, in medians of their shorter sides; see "Parts" in
#: docs/development/defaults.md.
_SLIP = 0.6
_DEGREES = np.array([1, 1, math.pi / 180])


def _outlines(poses: "ArrayLike", sizes: "ArrayLike") -> "jax.Array":
    from jaxpf.shapes.rectangles import corners_from_poses

    return corners_from_poses(poses, sizes)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the part model; see the help of each."""

    sharpness: float = sharpness_option(50.0, "likelihood.likelihood.sharpness")
    noise_pixels: tuple[float, ...] = noise_pixels_option(
        (3.0, 3.0, 3.5), factors=tuple(_DEGREES), tuned=("",)
    )
    noise_joints: tuple[float, ...] = option(
        (0.5, 0.5, 4.5),
        "Noise of a joint per frame: x and y in pixels, and degrees (parts only).",
        least=0,
        path="dynamics.joint_scale",
        common=True,
        factors=tuple(_DEGREES),
        tuned=("[2]",),
        implies=("dynamics", "relative"),
    )
    bands: int = bands_option(1)
    slip: float | None = slip_option()
    likelihood: str = likelihood_option("auto", "sampled", "patch")
    dynamics: str = option(
        "relative",
        "How parts move: relative (to their parents) or absolute (each on its own).",
        choices=PART_DYNAMICS,
        common=True,
        compiles=True,
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.likelihood == "patch" and self.bands > 1:
            raise InputError(
                Argument("bands", self.bands),
                " works only with histograms, but likelihood 'patch' compares pixels; leave one of "
                "them out.",
            )


class _PartTarget(Target):
    """Parts as a target; shapes are poses x, y (pixels), theta (radians)."""

    name = "parts"
    options = Options
    coordinates = ("x", "y", "angle")
    defaults: Mapping[str, Any] = {"method": "sps"}
    unsuited = ("labelled", "eskil", "pffl")  # part trees
    outlines_of_estimates = staticmethod(_outlines)
    example = "--parts parts.csv"
    columns = ("x", "y", "w", "h", "angle")
    fixed_columns = ("w", "h")
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "parts": {
            "type": Path,
            "help": "CSV of the parts of one or several articulated objects, with the header "
            "part,parent,x,y,w,h,angle (x, y: centre; angle: degrees clockwise; leave parent empty "
            "for each object's root).",
        }
    }

    def start(self, given: Parts, names: Sequence[object] | None = None) -> Start:
        check_type("parts", given, Parts)
        poses = numbers_in("poses", given.poses, "numbers x, y, theta of every part, [P, 3]")
        sizes = numbers_in("sizes", given.sizes, "numbers width, height of every part, [P, 2]")
        names, parents = given.names if names is None else names, check_tree(given.parents)
        check_names(names, len(parents))
        return Start(np.array(names), poses, sizes, parents)

    def likelihood(self, options: Options, start: Start, looks: Looks) -> "LikelihoodLike":
        """Parts learned from the start frame get log odds and a slip."""
        from jaxpf.contract.pytree import as_array
        from jaxpf.parts.models import with_log_odds

        learn = self._patch if options.likelihood == "patch" else self._histogram
        learned = learn(options, start, looks)
        if looks.frame is None:
            return learned
        slip = options.slip
        if slip is None:
            side = float(np.median(start.sizes.min(axis=1)))
            slip = looks.settings.get("slip", _SLIP * side)
        part = with_log_odds(learned, looks.frame, start.shapes, start.sizes, start.parents)
        return dataclasses.replace(part, slip=as_array(slip, float))

    def training_likelihood(
        self, options: Options, start: Start, looks: Looks, frames: np.ndarray
    ) -> "LikelihoodLike":
        """Bilinear histograms, as a ratio to those of random background boxes."""
        bilinear = {"interpolation": "bilinear", "form": "ratio", "background_frames": frames}
        return self._histogram(options, start, looks, **bilinear)

    def model(self, options: Options, start: Start, likelihood: "LikelihoodLike") -> Model:
        """The likelihood is of (u, v, scale, theta), or wrapped for parts."""
        from jaxpf.parts.models import parts_model

        return parts_model(
            likelihood,
            start.shapes,
            start.sizes,
            start.parents,
            dynamics=options.dynamics,
            scale=_DEGREES * options.noise_pixels,
            joint_scale=_DEGREES * options.noise_joints,
            reach=start.reach,
        )

    def _patch(self, options: Options, start: Start, looks: Looks) -> "LikelihoodLike":
        from jaxpf.likelihoods import patch, patch_from_pictures

        settings: dict[str, Any] = {
            "sigma": 1 / math.sqrt(options.sharpness),
            "window": _PATCH_WINDOW,
        }
        if looks.frame is None:
            return patch_from_pictures(looks.patches, start.sizes, **settings)
        return patch(looks.frame, start.shapes, start.sizes, **settings, names=_names(start))

    def _histogram(
        self, options: Options, start: Start, looks: Looks, **settings: Any
    ) -> "LikelihoodLike":
        from jaxpf.likelihoods import histogram_from_patches
        from jaxpf.parts.models import cut_pictures

        pictures = looks.patches
        if pictures is None:
            pictures = cut_pictures(looks.frame, start.shapes, start.sizes)
        return histogram_from_patches(
            pictures,
            start.sizes,
            sharpness=options.sharpness,
            bands=options.bands,
            method="sampled",
            samples=max(_SAMPLES, 2 * options.bands),
            names=_names(start),
            **settings,
        )

    def settled(self, options: Options, start: Start, looks: Looks) -> Options:
        if options.likelihood != "auto":
            return options
        return dataclasses.replace(options, likelihood="sampled")

    def shapes(self, start: Start, estimate: "ArrayLike", tracker: "TrackerLike") -> np.ndarray:
        return np.asarray(estimate)[..., :3]

    def outlines(self, start: Start, shapes: "ArrayLike") -> "jax.Array | np.ndarray":
        return _outlines(shapes, start.sizes)

    def read_start(self, given: Mapping[str, Any], number: int, source: "FrameSource") -> Start:
        path = given["parts"]
        if path is None:
            raise InputError(
                "no parts: give --parts FILE.csv.  Draw parts with "
                f"`jaxpf mark {source.path} --target parts`."
            )
        parts = read_parts(path)
        check_inside("the centre of part", parts.names, parts.poses[:, :2], source)
        return self.start(parts)

    def fits_scene(self, scene: "Scene") -> bool:
        """Whether the ground truth has poses and a part tree."""
        return {"poses", "parents"} <= set(scene.extras)

    def scene_shapes(self, scene: "Scene") -> np.ndarray:
        return np.asarray(scene.extras["poses"], np.float64)

    def scene_start(self, scene: "Scene") -> Start:
        parents = tuple(int(parent) for parent in scene.extras["parents"])
        ids = scene.extras.get("ids", range(1, len(parents) + 1))
        return self.start(Parts(tuple(ids), parents, scene.extras["poses"][0], scene.sizes))

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """Centre, size and clockwise angle in degrees."""
        sizes = np.broadcast_to(start.sizes, (*shapes.shape[:-1], 2))
        return np.concatenate([shapes[..., :2], sizes, np.rad2deg(shapes[..., 2:3])], axis=-1)

    def draw(self, frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
        from jaxpf.media.overlay import draw_outlines

        corners = np.asarray(self.outlines(start, np.asarray(shapes)), float)
        lines = np.concatenate([corners, corners[:, :1]], axis=1)
        return draw_outlines(frame, lines, start.ids, marks.colours, marks.lost, marks.doubtful)


PARTS = _PartTarget()


def _names(start: Start) -> list[str]:
    """How messages show the parts."""
    return [f"part '{name}'" for name in start.ids]
