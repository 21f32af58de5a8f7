"""Boxes: upright rectangles of free size, known by their colours.

A box is a partition with substate (u, v, a): centre in pixels and scale relative to the
size it started with (smith2004, section 2).
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.models.model import Model
from jaxpf.options import check_options
from jaxpf.targets.appearance import (
    bands_option,
    likelihood_option,
    naming,
    scale_option,
    sharpness_option,
    three_values,
)
from jaxpf.targets.target import Looks, Start, Target

if TYPE_CHECKING:
    from jaxpf.filters.partitioned.ordering import Ordering
    from jaxpf.filters.partitioned.tracker import Partitioned

#: Noise of centre (pixels) and scale per frame: wide enough for people walking in video.
DEFAULT_SCALE = (4.0, 2.0, 0.003)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the model of boxes; see the help of each."""

    sharpness: float = sharpness_option(20.0, "likelihood.sharpness")
    scale: tuple[float, ...] = scale_option(DEFAULT_SCALE)
    bands: int = bands_option(2)
    likelihood: str = likelihood_option("auto", "integral", "sampled")

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
    tuned_by_default = ("likelihood.sharpness", "dynamics.scale[0]", "dynamics.scale[1]")
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

    def model(self, options: Options, start: Start, looks: Looks) -> Model:
        """See ``Target``."""
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
                likelihood = histogram(looks.frame, start.shapes, **settings)
            else:
                likelihood = histogram_from_patches(
                    looks.patches, start.sizes, frame_shape=looks.frame_shape, **settings
                )
        return self._model(likelihood, options, start)

    def training_model(self, options: Options, start: Start, looks: Looks, frames: Any) -> Model:
        """See ``Target``: bilinear histograms, weighed against those of boxes anywhere."""
        from jaxpf.models.likelihoods.histogram import histogram_from_patches

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
        return box_model(likelihood, start.shapes, options.scale)

    def settled(self, options: Options, start: Start, looks: Looks) -> Options:
        """See ``Target``."""
        if options.likelihood != "auto":
            return options
        method = self.model(options, start, looks).likelihood.method
        return dataclasses.replace(options, likelihood=method)

    def noise(self, options: Options, start: Start) -> np.ndarray:
        """See ``Target``."""
        return np.array(options.scale)

    def tuned(self, options: Options, values: Mapping[str, Any]) -> Options:
        """See ``Target``."""
        for path, value in values.items():
            if path == "likelihood.sharpness":
                options = dataclasses.replace(options, sharpness=float(value))
            elif path.partition("[")[0] == "dynamics.scale":
                scale = three_values(options.scale, path, value)
                options = dataclasses.replace(options, scale=scale)
            else:
                raise InputError(f"a model of boxes has no {path}; apply the result to a tracker.")
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

    def draw(
        self, frame: Any, start: Start, shapes: Any, colours: Any, lost: Any, past: Any = None
    ) -> np.ndarray:
        """See ``Target``."""
        from jaxpf.media.overlay import draw_boxes

        return draw_boxes(frame, shapes, list(start.ids), colours, lost)


BOXES = Boxes()


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

    def append(self, frame: int, shapes: Any, lost: Any, ids: Any = None) -> None:
        ids = self._ids if ids is None else ids
        self._writer.append(frame, ids, shapes, np.where(lost, 0.0, 1.0))


def box_model(likelihood: Any, boxes: ArrayLike, scale: ArrayLike = DEFAULT_SCALE) -> Model:
    """Boxes that start where they are and move by smith2004's AR2 dynamics.

    Args:
        likelihood: of substates (u, v, a), such as ``jaxpf.likelihoods.histogram(...)``.
        boxes: x, y, w, h in pixels, ``[P, 4]``: where the objects are before the first frame.
        scale: noise of u, v (pixels) and a per frame, ``[3]`` or ``[P, 3]``.

    Raises:
        InputError: noise that is negative or not finite.
    """
    from jaxpf.models.dynamics import AR2

    boxes = np.asarray(boxes, np.float32).reshape(-1, 4)
    scale = np.asarray(scale, np.float32)
    if scale.shape[-1:] != (3,) or not np.all(np.isfinite(scale)) or np.any(scale < 0):
        raise InputError(
            f"scale {scale.tolist()} must be three finite numbers >= 0: the noise of x and y in "
            "pixels and of the relative size, such as 4,2,0.003."
        )
    centres = boxes[:, :2] + boxes[:, 2:] / 2
    return Model(
        dynamics=AR2(scale=scale),
        likelihood=likelihood,
        initial=np.concatenate([centres, np.ones((len(boxes), 1), np.float32)], axis=1),
        parents=(-1,) * len(boxes),
    )


def box_tracker(
    likelihood: Any,
    boxes: ArrayLike,
    ordering: "Ordering",
    *,
    scale: ArrayLike = DEFAULT_SCALE,
    num_particles: int = 300,
    resampling: str = "systematic",
    ess_threshold: float | None = None,
) -> "Partitioned":
    """A partitioned filter of boxes, for any likelihood and ordering.

    Args:
        likelihood: see ``box_model``, like the next one and ``scale``.
        boxes: see there.
        ordering: from ``jaxpf.ordering``.
        scale: see there.
        num_particles: N.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.
        ess_threshold: see ``Partitioned``.

    Raises:
        InputError: see ``box_model`` and ``check_tracker``.
    """
    from jaxpf.filters.partitioned.tracker import Partitioned

    return Partitioned(
        **box_model(likelihood, boxes, scale)._asdict(),
        ordering=ordering,
        num_particles=num_particles,
        resampling=resampling,
        ess_threshold=ess_threshold,
    )


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
        options: of ``Options``.

    Raises:
        InputError: an argument is out of range; the sentence says which.
    """
    start = BOXES.scene_start(scene)
    chosen = Options(**options)
    looks = Looks(None, scene.patches, scene.frames.shape[1:3], num_particles, num_runs)
    return box_tracker(
        BOXES.model(chosen, start, looks).likelihood,
        start.shapes,
        ordering,
        scale=chosen.scale,
        num_particles=num_particles,
        resampling=resampling,
    )
