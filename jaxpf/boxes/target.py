"""The box target: upright rectangles of variable size, recognised by colour.

A substate is (u, v, a): centre in pixels and scale relative to the start (smith2004, section 2).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.boxes import tracks
from jaxpf.boxes.models import (
    box_model,
    boxes_at,
    reach_of,
    relative_box_model,
    relative_steps,
)
from jaxpf.boxes.options import Options
from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model
from jaxpf.contract.options import OPEN, plain
from jaxpf.targets.appearance import (
    COLOUR,
    DISCRIMINATIVE,
    NONE,
    PIXELS,
    PRETRAINED,
    RELATIVE,
    check_contrast,
)
from jaxpf.targets.later import starts_by_frame
from jaxpf.targets.target import Looks, Marks, Start, Target

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.media.frame_source import FrameSource
    from scenes import Scene


#: Appearance -> default sharpness.
_SHARPNESS = {COLOUR: 20.0, DISCRIMINATIVE: 1.0, PRETRAINED: 1.0}


class _BoxTarget(Target):
    """Boxes as a target; shapes are boxes x, y, w, h in pixels."""

    name = "boxes"
    options = Options
    coordinates = ("x", "y", "scale")
    has_boxes = True
    example = "--box 120,80,40,90 --box 300,85,42,88"
    columns = ("x", "y", "w", "h")
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "box": {"multiple": True, "metavar": "X,Y,W,H", "help": "A start box; repeat it."},
        "boxes": {
            "type": Path,
            "help": "CSV of start boxes, such as frame,id,x,y,w,h.  With that header, or that of a "
            "tracks.csv, frames and x, y count from 0; without a header, as in MOT files, from 1.  "
            "A box in a later frame starts its object there, or corrects it.",
        },
        "ids": {"type": [int], "help": "Objects of --boxes, such as 1,2,5."},
        "detections": {
            "type": Path,
            "help": "Detections that start and end tracks: a MOT det.txt.  Objects are tracked by "
            "colour and the labelled filter, by default with 100 particles for each of "
            "--capacity.  A line with an id in the place of -1 starts that object there, detected "
            "or not.",
        },
    }

    def start(self, given: Any, names: Sequence[object] | np.ndarray | None = None) -> Start:
        """Boxes ``[P, 4]``; default names are numbers from 1."""
        boxes = np.asarray(given, np.float64)
        ids = np.arange(1, len(boxes) + 1) if names is None else np.asarray(names)
        return Start(ids, boxes, boxes[:, 2:], (-1,) * len(boxes))

    def resolved(
        self, options: Options, settings: Mapping[str, Any], num_objects: int | None = None
    ) -> Options:
        """By default discriminative appearance with its sharpness, and relative motion."""
        appearance, motion = options.appearance, options.motion
        if appearance == OPEN:
            appearance = settings.get("appearance", DISCRIMINATIVE)
        if motion == OPEN:
            motion = PIXELS if appearance == COLOUR else RELATIVE
        sharpness = options.sharpness
        if sharpness is None:
            sharpness = _SHARPNESS[appearance]
        options = dataclasses.replace(
            options, appearance=appearance, motion=motion, sharpness=sharpness
        )
        if motion != RELATIVE or num_objects is None:
            return options
        steps = relative_steps(options.noise_relative, num_objects)
        return dataclasses.replace(options, noise_relative=tuple(steps.ravel().tolist()))

    def likelihood(self, options: Options, start: Start, looks: Looks) -> Any:
        from jaxpf.likelihoods.histogram import histogram, histogram_from_patches

        if options.appearance == DISCRIMINATIVE:
            return self._discriminative(options, start, looks)
        if options.appearance == PRETRAINED:
            return self._pretrained(options, start, looks)
        settings: dict[str, Any] = {
            "sharpness": options.sharpness,
            "bands": options.bands,
            "method": options.likelihood,
            "num_particles": looks.num_particles,
            "names": _names(start),
        }
        if looks.patches is None:
            check_contrast(looks.frame, start.shapes, _names(start))
            return histogram(looks.frame, start.shapes, **settings)
        return histogram_from_patches(
            looks.patches, start.sizes, frame_shape=looks.frame_shape, **settings
        )

    def training_likelihood(
        self, options: Options, start: Start, looks: Looks, frames: np.ndarray
    ) -> "LikelihoodLike":
        """Bilinear features, as a ratio to those of random background boxes."""
        from jaxpf.likelihoods.histogram import histogram_from_patches

        if len(options.noise_relative or ()) > 3:
            raise InputError(
                f"noise_relative {plain(options.noise_relative)} differs between objects, and "
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
            bands=options.bands,
            method="integral",
            frame_shape=looks.frame_shape,
            interpolation="bilinear",
            form="ratio",
            background_frames=frames,
        )

    def _discriminative(
        self, options: Options, start: Start, looks: Looks, **settings: Any
    ) -> "LikelihoodLike":
        from jaxpf.likelihoods.discriminative import discriminative
        from jaxpf.likelihoods.exclusion import excluding

        if options.motion == RELATIVE:
            steps = relative_steps(options.noise_relative, len(start.shapes))
            settings["reach"] = reach_of(steps)
        settings |= {"sharpness": options.sharpness, "names": _names(start)}
        likelihood = discriminative(looks.start_frame, start.shapes, **settings)
        check_contrast(looks.start_frame, start.shapes, _names(start))
        return likelihood if options.exclusion == NONE else excluding(likelihood)

    def _pretrained(self, options: Options, start: Start, looks: Looks) -> "LikelihoodLike":
        from jaxpf.likelihoods.exclusion import excluding
        from jaxpf.likelihoods.pretrained import efficientnet_lite0, pretrained

        frame, shown = looks.start_frame, _names(start)
        network = efficientnet_lite0(options.network)
        likelihood = pretrained(
            frame, start.shapes, network=network, sharpness=options.sharpness, names=shown
        )
        check_contrast(frame, start.shapes, shown)
        return likelihood if options.exclusion == NONE else excluding(likelihood)

    def model(self, options: Options, start: Start, likelihood: Any) -> Model:
        """Substates are (u, v, a)."""
        if options.motion != RELATIVE:
            return box_model(likelihood, start.shapes, options.noise_pixels)
        steps = relative_steps(options.noise_relative, len(start.shapes))
        return relative_box_model(likelihood, start.shapes, steps, options.momentum)

    def settled(self, options: Options, start: Start, looks: Looks) -> Options:
        options = self.resolved(options, looks.settings)
        if options.appearance != COLOUR or options.likelihood != OPEN:
            return options
        method = self.likelihood(options, start, looks).method
        return dataclasses.replace(options, likelihood=method)

    def shapes(self, start: Start, estimate: "ArrayLike", tracker: "TrackerLike") -> np.ndarray:
        return boxes_at(estimate, start.sizes)

    def outlines(self, start: Start, shapes: "ArrayLike") -> "jax.Array | np.ndarray":
        import jax.numpy as jnp

        x, y, w, h = jnp.moveaxis(jnp.asarray(shapes), -1, 0)
        corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
        return jnp.stack([jnp.stack(corner, axis=-1) for corner in corners], axis=-2)

    def measures(self, start: Start, shapes: "ArrayLike", truth: "ArrayLike") -> dict[str, Any]:
        """Exact measures for boxes."""
        import jax.numpy as jnp

        from jaxpf.measures import metrics

        return {
            "present": metrics.has_truth(truth),
            "tracked": metrics.track_state(shapes, truth),
            "precision": metrics.precision(shapes, truth),
            "recall": metrics.recall(shapes, truth),
            "iou": metrics.iou(shapes, truth),
            "centre_error": metrics.centre_error(shapes, truth),
            "corner_error": jnp.full(jnp.shape(shapes)[:-1], jnp.nan),
        }

    def read_start(self, given: Mapping[str, Any], number: int, source: "FrameSource") -> Start:
        from jaxpf.sequences.layouts import read_truth

        if given["box"] and given["boxes"]:
            raise InputError("--box and --boxes were both given; use one of them.")
        if given["ids"] is not None and not given["boxes"]:
            raise InputError("--ids names objects of a CSV file; give the file with --boxes.")
        if given["boxes"]:
            table = read_truth(given["boxes"])
            ids, boxes = tracks.start_boxes(table, number, _starting(table, number, given["ids"]))
        elif given["box"]:
            boxes = np.stack([tracks.parse_box(text) for text in given["box"]])
            ids = np.arange(1, len(boxes) + 1)
        elif given.get("detections"):
            return self.start(np.zeros((0, 4)))
        else:
            raise InputError(
                "no start box: give --box x,y,w,h for every object, or --boxes FILE.csv.  Draw the "
                f"start boxes with `jaxpf mark {source.path}`."
            )
        tracks.check_boxes(boxes, source.width, source.height, [f"object {i}" for i in ids])
        return self.start(boxes, ids)

    def later_starts(
        self, given: Mapping[str, Any], number: int, source: "FrameSource"
    ) -> tuple[dict[int, Start], str | None]:
        """Boxes of later frames in the file of --boxes."""
        from jaxpf.sequences.layouts import read_truth

        if not given["boxes"]:
            return {}, None
        table = read_truth(given["boxes"])
        ids = table.id if given["ids"] is None else given["ids"]
        named = np.isin(table.id, ids)

        def start_at(frame: int) -> Start:
            rows = named & (table.frame == frame)
            names = [f"object {i} in frame {frame}" for i in table.id[rows]]
            tracks.check_boxes(table.box[rows], source.width, source.height, names)
            return self.start(table.box[rows], table.id[rows])

        later, note = starts_by_frame(table.frame[named], table.id[named], number, start_at)
        here = table.id[table.frame == number]
        absent = np.setdiff1d(ids, np.concatenate([here, *(each.ids for each in later.values())]))
        if given["ids"] is not None and len(absent):
            raise InputError(
                f"id {absent[0]} has no box in frame {number} of {table.source}, which holds whole "
                "tracks, so that only its start frame is used; choose another --start."
            )
        return later, note

    def fits_scene(self, scene: "Scene") -> bool:
        """Every scene has boxes."""
        return True

    def scene_shapes(self, scene: "Scene") -> np.ndarray:
        return np.asarray(scene.boxes, np.float64)

    def scene_start(self, scene: "Scene") -> Start:
        return self.start(scene.boxes[0], scene.extras.get("ids"))

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """The top left corner and the size."""
        return shapes

    def draw(self, frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
        from jaxpf.media.overlay import draw_boxes

        return draw_boxes(frame, shapes, list(start.ids), marks.colours, marks.lost, marks.doubtful)


BOXES = _BoxTarget()


def _starting(table: "tracks.BoxTable", number: int, ids: Sequence[int] | None) -> list[int] | None:
    """Those of the ids asked for that do not start in a later frame."""
    if ids is None:
        return None
    here, later = table.id[table.frame == number], table.id[table.frame > number]
    return [each for each in ids if each in here or each not in later]


def _names(start: Start) -> list[str]:
    """How messages show the boxes."""
    return [f"the box of object {number}" for number in start.ids]
