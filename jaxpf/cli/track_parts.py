"""``jaxpf track --parts-file``: the parts of an articulated object through a video."""

import math
import re
from typing import Any

import click
import numpy as np

from jaxpf.cli.recorder import Recorder
from jaxpf.errors import InputError

LIKELIHOODS = ("auto", "sampled", "patch")
_DYNAMICS = ("relative", "absolute")

#: What the options are where the user says nothing; `jaxpf track` has others for boxes.
_DEFAULTS: dict[str, Any] = {"method": "sps", "parts": 1, "sharpness": 50.0, "scale": [3, 3, 3.5]}

# Samples per side of a part: its likelihood is then off by .017 sharpness, see
# jaxpf.likelihoods._sampled.
_SAMPLES = 10
_PATCH_WINDOW = (12, 12)


def complete(options: dict[str, Any]) -> None:
    """Fill in what parts need and refuse what they have no use for."""
    from click.core import ParameterSource

    source = click.get_current_context().get_parameter_source
    for name, value in _DEFAULTS.items():
        if source(name) is ParameterSource.DEFAULT:
            options[name] = value
    for name in ("box", "boxes", "ids", "truth"):
        if options[name]:
            raise InputError(
                f"--{name} is about boxes and --parts-file about parts; use one of them."
            )
    if options["dynamics"] not in _DYNAMICS:
        raise InputError(
            f"--dynamics {options['dynamics']!r} is unknown; choose one of {', '.join(_DYNAMICS)}."
        )
    if options["likelihood"] not in LIKELIHOODS:
        raise InputError(
            f"--likelihood {options['likelihood']!r} is not for parts; choose one of "
            f"{', '.join(LIKELIHOODS)}."
        )
    if options["particles"] < 2:
        raise InputError(
            f"--particles {options['particles']} leaves nothing to choose from; use 2 or more."
        )


def start_parts(options: dict[str, Any], width: int, height: int) -> Any:
    """The parts of the file, all of them with their centre in the frame."""
    from jaxpf.files.parts import read_parts

    parts = read_parts(options["parts_file"])
    for name, (x, y, _) in zip(parts.names, parts.poses, strict=True):
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(
                f"part '{name}' of '{options['parts_file']}' has its centre ({x:g},{y:g}) outside "
                f"the {width}x{height} frame; give x and y of the centre, in pixels."
            )
    return parts


def build_tracker(options: dict[str, Any], first: np.ndarray, parts: Any) -> Any:
    """A tracker that starts at the parts and learns their looks from the first frame."""
    from jaxpf.targets.parts import ordering_of_parts, parts_tracker

    order = options["order"]
    if order is not None and sorted(order) != list(range(len(parts.names))):
        raise InputError(
            f"--order {','.join(map(str, order))} is not a permutation of the {len(parts.names)} "
            f"parts; name each of 0 to {len(parts.names) - 1} once, in the numbering of the file."
        )
    ordering = ordering_of_parts(
        options["method"], parts.parents, order=order, swap=options["swap"]
    )
    try:
        likelihood = _learn(options, first, parts)
    except InputError as error:
        # The library counts its parts from 0; people know them by name.
        raise InputError(
            re.sub(
                r"(?:boxes|sizes|patches|pictures)\[(\d+)\]|the window of object (\d+)",
                lambda match: f"part '{parts.names[int(match[1] or match[2])]}'",
                str(error),
            )
        ) from None
    degrees = np.array([1, 1, math.pi / 180])
    return parts_tracker(
        likelihood,
        parts.poses,
        parts.sizes,
        ordering,
        parts.parents,
        dynamics=options["dynamics"],
        scale=degrees * options["scale"],
        joint_scale=degrees * options["joint_scale"],
        num_particles=options["particles"],
        resampling=options["resampling"],
        ess_threshold=options["ess_threshold"],
    )


def _learn(options: dict[str, Any], first: np.ndarray, parts: Any) -> Any:
    from jaxpf.models.likelihoods import histogram_from_patches, patch
    from jaxpf.targets.parts import cut_pictures

    if options["likelihood"] == "patch":
        sigma = 1 / math.sqrt(options["sharpness"])
        return patch(first, parts.poses, parts.sizes, sigma=sigma, window=_PATCH_WINDOW)
    return histogram_from_patches(
        cut_pictures(first, parts.poses, parts.sizes),
        parts.sizes,
        sharpness=options["sharpness"],
        parts=options["parts"],
        method="sampled",
        samples=max(_SAMPLES, 2 * options["parts"]),
    )


class PartRecorder(Recorder):
    """Writes everything that a run on parts leaves behind, frame by frame."""

    def __init__(self, output, source, options, parts, tracker):
        self.parts = parts
        super().__init__(output, source, options, np.array(parts.names), parts.poses, tracker)

    def _new_tracks(self, path):
        from jaxpf.files.parts import PartTrackWriter

        return PartTrackWriter(path)

    def _estimate(self, substates):
        return np.asarray(substates[:, :3], float)

    def _corners(self, poses):
        from jaxpf.models.geometry import corners_from_poses

        return np.asarray(corners_from_poses(poses, self.parts.sizes), float)

    def _bounds(self, poses):
        corners = self._corners(poses)
        lowest = corners.min(axis=1)
        return np.concatenate([lowest, corners.max(axis=1) - lowest], axis=1)

    def _write(self, number, poses, lost):
        self.tracks.append(number, self.ids, poses, self.parts.sizes)

    def _paint(self, frame, poses, lost):
        from jaxpf.media.overlay import draw_rectangles

        return draw_rectangles(frame, self._corners(poses), self.ids, self.colours, lost)

    def _likelihood_method(self):
        return "patch" if self.options["likelihood"] == "patch" else "sampled"
