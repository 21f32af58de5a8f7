"""Boxes: upright rectangles of free size, known by their colours.

A substate is (u, v, a): centre in pixels and scale relative to the start (smith2004, section 2).
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.errors import InputError
from jaxpf.models.model import Model
from jaxpf.options import OPEN, check_options, plain
from jaxpf.targets.appearance import (
    COLOUR,
    DISCRIMINATIVE,
    NONE,
    PIXELS,
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
    scale_option,
    sharpness_option,
    steps_option,
    three_values,
)
from jaxpf.targets.box_models import (
    DEFAULT_MOMENTUM,
    DEFAULT_SCALE,
    DEFAULT_STEPS,
    box_model,
    motion_candidates,
    relative_box_model,
)
from jaxpf.targets.box_models import box_tracker as box_tracker  # which boxes show as their own
from jaxpf.targets.target import Looks, Marks, Start, Target, looks_of_scene

if TYPE_CHECKING:
    from jaxpf.filters.partitioned.ordering import Ordering
    from jaxpf.filters.partitioned.tracker import Partitioned

#: Options by tracker path, and what they imply.
_TUNED = {
    "likelihood.sharpness": ("sharpness", "appearance", COLOUR),
    "likelihood.gain": ("gain", "appearance", DISCRIMINATIVE),
    "dynamics.scale": ("scale", "motion", PIXELS),
    "dynamics.steps": ("relative_scale", "motion", RELATIVE),
}


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the model of boxes; see the help of each."""

    sharpness: float = sharpness_option(20.0, "likelihood.sharpness")
    scale: tuple[float, ...] = scale_option(DEFAULT_SCALE)
    bands: int = bands_option(2)
    likelihood: str = likelihood_option("auto", "integral", "sampled")
    appearance: str = appearance_option()
    gain: float = gain_option(4.0)
    motion: str = motion_option()
    relative_scale: tuple[float, ...] = steps_option(DEFAULT_STEPS)
    momentum: float = momentum_option(DEFAULT_MOMENTUM)
    exclusion: str = exclusion_option()

    def __post_init__(self) -> None:
        check_options(self)


class Boxes(Target):
    """Boxes as a target; shapes are boxes x, y, w, h in pixels."""

    name = "boxes"
    noun = "object"
    options = Options
    # A detector says where somebody is, which the picture has only to refine.
    open_defaults: Mapping[str, Any] = {"sharpness": 1.0, "scale": (6.0, 4.0, 0.02)}
    has_boxes = True
    track_suffix = ".txt"
    start_flags: Mapping[str, Mapping[str, Any]] = {
        "box": {"multiple": True, "metavar": "X,Y,W,H", "help": "A start box; repeat it."},
        "boxes": {
            "type": Path,
            "help": "CSV of start boxes: MOT format (frames and x, y from 1), or with the header "
            "frame,id,x,y,w,h (from 0).",
        },
        "ids": {"type": [int], "help": "Objects of --boxes, such as 1,2,5."},
        "births": {
            "type": Path,
            "help": "Objects come and go by detections: a MOT det.txt, sorted by frame.  A line "
            "with an id in the place of -1 starts that object there, detected or not.",
        },
    }

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Target``."""
        from jaxpf.files import tracks

        if given["box"] and given["boxes"]:
            raise InputError("--box and --boxes were both given; use one of them.")
        if given["ids"] is not None and not given["boxes"]:
            raise InputError("--ids names objects of a CSV file; give the file with --boxes.")
        if given["boxes"]:
            table = tracks.read_boxes(given["boxes"])
            ids, boxes = tracks.start_boxes(table, number, given["ids"])
        elif given["box"]:
            boxes = np.stack([tracks.parse_box(text) for text in given["box"]])
            ids = np.arange(1, len(boxes) + 1)
        elif given.get("births"):
            return _start(np.zeros(0, int), np.zeros((0, 4)))
        else:
            raise InputError(
                "no start box: give --box x,y,w,h for every object, or --boxes FILE.csv "
                f"(`jaxpf frame {source.path}` saves a frame with a pixel grid to read them off)."
            )
        tracks.check_boxes(boxes, source.width, source.height, [f"object {i}" for i in ids])
        return _start(ids, boxes)

    def fits_scene(self, scene: Any) -> bool:
        """Every scene has boxes."""
        return True

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Target``."""
        return np.asarray(scene.boxes, np.float64)

    def scene_start(self, scene: Any) -> Start:
        """See ``Target``."""
        return _start(scene_ids(scene), np.asarray(scene.boxes[0]))

    def resolved(self, options: Options, is_filmed: bool) -> Options:
        """See ``Target``: what is filmed has looks and surroundings worth learning."""
        appearance, motion = options.appearance, options.motion
        if appearance == OPEN:
            appearance = DISCRIMINATIVE if is_filmed else COLOUR
        if motion == OPEN:
            motion = RELATIVE if appearance == DISCRIMINATIVE else PIXELS
        return dataclasses.replace(options, appearance=appearance, motion=motion)

    def model(self, options: Options, start: Start, looks: Looks) -> Model:
        """See ``Target``."""
        options = self.resolved(options, looks.is_filmed)
        if options.appearance == DISCRIMINATIVE:
            return self._model(self._discriminative(options, start, looks), options, start)
        return self._model(self._colour(options, start, looks), options, start)

    def _discriminative(self, options: Options, start: Start, looks: Looks, **settings: Any) -> Any:
        from jaxpf.models.likelihoods.discriminative import discriminative, excluding

        with naming([f"the box of object {number}" for number in start.ids]):
            found = discriminative(looks.start_frame, start.shapes, gain=options.gain, **settings)
        return found if options.exclusion == NONE else excluding(found)

    def _colour(self, options: Options, start: Start, looks: Looks) -> Any:
        from jaxpf.models.likelihoods.histogram import histogram, histogram_from_patches

        settings: dict[str, Any] = {
            "sharpness": options.sharpness,
            "parts": options.bands,
            "method": options.likelihood,
            "num_particles": looks.num_particles,
            "num_runs": looks.num_runs,
        }
        with naming([f"the box of object {number}" for number in start.ids]):
            if looks.patches is None:
                check_contrast(looks.frame, start.shapes)
                return histogram(looks.frame, start.shapes, **settings)
            return histogram_from_patches(
                looks.patches, start.sizes, frame_shape=looks.frame_shape, **settings
            )

    def training_model(self, options: Options, start: Start, looks: Looks, frames: Any) -> Model:
        """See ``Target``: bilinear features, weighed against those of boxes anywhere."""
        from jaxpf.models.likelihoods.histogram import histogram_from_patches

        options = self.resolved(options, looks.is_filmed)
        if len(options.relative_scale) > 3:
            raise InputError(
                f"relative_scale {plain(options.relative_scale)} differs between objects, and "
                "tuning finds one motion for all; give three numbers."
            )
        if options.appearance == DISCRIMINATIVE:
            settings = {"interpolation": "bilinear", "background_frames": frames}
            learned = self._discriminative(options, start, looks, **settings)
            return self._model(learned, options, start)
        likelihood = histogram_from_patches(
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
        return self._model(likelihood, options, start)

    def open_model(
        self, options: Options, capacity: int, typical_size: tuple[float, float], looks: Looks
    ) -> Model:
        """See ``Target``."""
        from jaxpf.targets.populations import open_box_model

        if DISCRIMINATIVE in options.appearance or RELATIVE in options.motion:
            raise InputError(
                "objects that come and go are known by colour and move by pixels, because there is "
                "no start frame to learn from; leave out --appearance and --motion."
            )
        return open_box_model(
            looks.frame_shape,
            capacity,
            typical_size=typical_size,
            scale=options.scale,
            sharpness=options.sharpness,
            bands=options.bands,
            likelihood=options.likelihood,
            num_particles=looks.num_particles,
        )

    def _model(self, likelihood: Any, options: Options, start: Start) -> Model:
        if options.motion == RELATIVE:
            steps = _steps(options, start)
            return relative_box_model(likelihood, start.shapes, steps, options.momentum)
        return box_model(likelihood, start.shapes, options.scale)

    def motion_candidates(self, options: Options) -> list[Options]:
        """See ``Target``."""
        return motion_candidates(options)

    def with_motion(self, model: Model, options: Options, start: Start) -> Model:
        """See ``Target``."""
        return self._model(model.likelihood, options, start)

    def settled(self, options: Options, start: Start, looks: Looks) -> Options:
        """See ``Target``."""
        options = self.resolved(options, looks.is_filmed)
        if options.appearance != COLOUR or options.likelihood != OPEN:
            return options
        method = self.model(options, start, looks).likelihood.method
        return dataclasses.replace(options, likelihood=method)

    def noise(self, options: Options, start: Start) -> np.ndarray:
        """See ``Target``."""
        if options.motion == RELATIVE:
            from jaxpf.models.relative_motion import RelativeMotion

            size = np.sqrt(np.prod(start.sizes, axis=1))
            usual, far, of_size = _steps(options, start).T
            long = RelativeMotion.long
            step = np.mean(size * np.sqrt((1 - long) * usual**2 + long * far**2))
            return np.array([step, step, of_size.mean()])
        return np.array(options.scale)

    def tuned_by_default(self, options: Options) -> tuple[str, ...]:
        """See ``Target``."""
        trust = "gain" if options.appearance == DISCRIMINATIVE else "sharpness"
        noise = "steps" if options.motion == RELATIVE else "scale"
        return f"likelihood.{trust}", f"dynamics.{noise}[0]", f"dynamics.{noise}[1]"

    def tuned(self, options: Options, values: Mapping[str, Any]) -> Options:
        """See ``Target``."""
        for path, value in values.items():
            if path.partition("[")[0] not in _TUNED:
                raise InputError(f"a model of boxes has no {path}; apply the result to a tracker.")
            name, other, implied = _TUNED[path.partition("[")[0]]
            if name in ("scale", "relative_scale"):
                value = three_values(getattr(options, name), path, value)
            else:
                value = float(value)
            options = dataclasses.replace(options, **{name: value, other: implied})
        return options

    def positions(self, start: Start, shapes: Any) -> Any:
        """See ``Target``."""
        from jaxpf.models.geometry import substates_from_boxes

        return substates_from_boxes(shapes, start.sizes)

    def shapes(self, start: Start, estimate: Any) -> np.ndarray:
        """See ``Target``; in NumPy: one arithmetic wherever it is done."""
        estimate = np.asarray(estimate)
        extent = estimate[..., 2:3] * start.sizes.astype(estimate.dtype)
        return np.concatenate([estimate[..., :2] - extent / 2, extent], axis=-1)

    def outlines(self, start: Start, shapes: Any) -> Any:
        """See ``Target``."""
        import jax.numpy as jnp

        x, y, w, h = jnp.moveaxis(jnp.asarray(shapes), -1, 0)
        corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
        return jnp.stack([jnp.stack(corner, axis=-1) for corner in corners], axis=-2)

    def scaled(
        self, start: Start, shapes: np.ndarray, factors: tuple[float, float]
    ) -> tuple[Start, np.ndarray]:
        """See ``Target``."""
        return start, shapes * np.tile(factors, 2)

    def measures(self, start: Start, shapes: Any, truth: Any) -> dict[str, Any]:
        """See ``Target``: those of boxes, which are exact."""
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

    def track_writer(self, path: Any, start: Start) -> Any:
        """See ``Target``: MOT format."""
        return _MotWriter(path, start)

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Target``."""
        from jaxpf.media.overlay import draw_boxes

        return draw_boxes(frame, shapes, list(start.ids), marks.colours, marks.lost, marks.doubtful)


BOXES = Boxes()


def _steps(options: Options, start: Start) -> np.ndarray:
    """Noise of relative motion, ``[3]`` for all objects or ``[P, 3]``.

    Raises:
        InputError: it is for another number of objects.
    """
    steps, count = np.reshape(options.relative_scale, (-1, 3)), len(start.shapes)
    if len(steps) not in (1, count):
        raise InputError(
            f"relative_scale {plain(options.relative_scale)} is for {len(steps)} objects, and "
            f"there are {count}; give three numbers for all, or three for every object."
        )
    return steps if len(steps) > 1 else steps[0]


def _start(ids: Any, boxes: np.ndarray) -> Start:
    boxes = np.asarray(boxes, np.float64)
    return Start(np.asarray(ids), boxes, boxes[:, 2:], (-1,) * len(boxes))


def scene_ids(scene: Any) -> np.ndarray:
    """The truth's numbers of a scene's objects; from 1 where it has none."""
    return np.asarray(scene.extras.get("ids", np.arange(1, scene.boxes.shape[1] + 1)))


class _MotWriter:
    """Boxes of one run, frame by frame, in MOT format."""

    def __init__(self, path: Any, start: Start):
        from jaxpf.files.tracks import TrackWriter

        self._ids, self._writer = start.ids, TrackWriter(path)

    def __enter__(self) -> "_MotWriter":
        self._writer.__enter__()
        return self

    def __exit__(self, *exception: Any) -> Any:
        return self._writer.__exit__(*exception)

    def append(
        self, frame: int, shapes: Any, lost: Any, ids: Any = None, confidence: Any = 1.0
    ) -> None:
        ids = self._ids if ids is None else ids
        self._writer.append(frame, ids, shapes, np.where(lost, 0.0, confidence))


def scene_tracker(
    scene: Any,
    ordering: "Ordering",
    *,
    num_particles: int = 300,
    resampling: str = "systematic",
    num_runs: int = 1,
    **options: Any,
) -> "Partitioned":
    """A tracker that starts at a scene's first true boxes and knows its patches.

    Args:
        scene: see ``scenes.Scene``; every object must have a box in its first frame.
        ordering: see ``jaxpf.ordering``.
        num_particles: N.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.
        num_runs: runs that share a frame's work, where cost decides how histograms are computed.
        options: of ``Options``; the appearance is colour where none is named.

    Raises:
        InputError: an argument is out of range; the sentence says which.
    """
    from jaxpf.filters.partitioned.tracker import Partitioned

    start = BOXES.scene_start(scene)
    chosen = Options(**{"appearance": COLOUR, **options})
    looks = looks_of_scene(scene, num_particles, num_runs)
    return Partitioned(
        **BOXES.model(chosen, start, looks)._asdict(),
        ordering=ordering,
        num_particles=num_particles,
        resampling=resampling,
    )
