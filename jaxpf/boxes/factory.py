"""Builds trackers of boxes: one upright rectangle per object.

A substate is (u, v, a): centre in pixels and scale relative to the start (smith2004, section 2).
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from jaxpf import filters
from jaxpf.boxes.models import (
    DEFAULT_MOMENTUM,
    DEFAULT_SCALE,
    DEFAULT_STEPS,
    LONE_STEPS,
    box_model,
    boxes_at,
    reach_of,
    relative_steps,
)
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import MOST, plain
from jaxpf.contract.options import OPEN, Option
from jaxpf.contract.types import LikelihoodLike
from jaxpf.likelihoods.discriminative import discriminative
from jaxpf.likelihoods.exclusion import excluding
from jaxpf.likelihoods.histogram import histogram, histogram_from_patches
from jaxpf.likelihoods.pixels import PixelLikelihood
from jaxpf.likelihoods.pretrained import efficientnet_lite0, pretrained
from jaxpf.targets.building import Network, TrackerOptions, factory, looks_of
from jaxpf.targets.target import Looks, Start

#: Appearance -> default sharpness.
_SHARPNESS = {"colour": 20.0, "discriminative": 1.0, "pretrained": 1.0}
#: A region whose grey levels differ by at most this counts as one colour.
_ONE_COLOUR = 2


@factory("boxes")
def tracker(
    frame: ArrayLike | Looks | None,
    boxes: ArrayLike | Start,
    *,
    likelihood: Annotated[
        Literal["auto", "integral", "sampled"] | LikelihoodLike,
        Option(
            "How colour histograms are computed: from integral or sampled ones, or auto for the "
            "faster (colour appearance only).",
            compiles=True,
            needs=("appearance", "colour"),
            rare=True,
        ),
    ] = "auto",
    patches: Sequence[np.ndarray] | None = None,
    appearance: Annotated[
        Literal["auto", "colour", "discriminative", "pretrained"],
        Option(
            "Appearance model: colour, discriminative, pretrained or auto (discriminative in "
            "video).  Colour compares histograms; discriminative learns in the start frame to "
            "distinguish each object from its surroundings, by colours and gradients; pretrained "
            "also by the features of a small network, which usually lose fewer objects (pip "
            "install 'jaxpf[pretrained]').  Auto is colour in synthetic scenes.",
            compiles=True,
        ),
    ] = "auto",
    sharpness: Annotated[
        float | None,
        Option(
            "Sharpness S of the likelihood, such as exp(-S d^2) of the colour distance d: larger "
            "trusts appearance more, and gives narrower intervals.  By default 20 for colour, and "
            "1 for learned appearance.",
            above=0,
            path="likelihood.sharpness",
            tuned=("",),
        ),
    ] = None,
    noise_pixels: Annotated[
        tuple[float, float, float],
        Option(
            "Noise per frame: x and y in pixels, and the relative size (pixel motion only).",
            least=0,
            path="dynamics.scale",
            tuned=("[0]", "[1]"),
            needs=("motion", "pixels"),
        ),
    ] = DEFAULT_SCALE,
    bands: Annotated[
        int,
        Option(
            "Number of horizontal bands, each with a colour histogram of its own (colour "
            "appearance only).",
            least=1,
            most=MOST,
            compiles=True,
            needs=("appearance", "colour"),
            rare=True,
        ),
    ] = 2,
    network: Network = None,
    motion: Annotated[
        Literal["auto", "pixels", "relative"],
        Option(
            "Unit of the noise: pixels (noise_pixels), relative to the object's size "
            "(noise_relative) or auto.  Relative noise is heavy-tailed; auto is relative unless "
            "appearance is colour.",
            compiles=True,
        ),
    ] = "auto",
    noise_relative: Annotated[
        tuple[float, ...] | None,
        Option(
            "Noise per frame, three standard deviations: of usual steps and of occasional long "
            "ones, as shares of the object's size, and of the logarithm of the size; by default "
            f"{plain(DEFAULT_STEPS)}, and {plain(LONE_STEPS)} for a single object (relative motion "
            "only).  Three numbers for all objects, or three for each.",
            length=3,
            least=0,
            per_object=True,
            path="dynamics.steps",
            tuned=("[0]", "[1]"),
            needs=("motion", "relative"),
        ),
    ] = None,
    momentum: Annotated[
        float,
        Option(
            "Share of the last displacement that is repeated (relative motion only).",
            least=0,
            most=1,
            needs=("motion", "relative"),
            rare=True,
        ),
    ] = DEFAULT_MOMENTUM,
    exclusion: Annotated[
        Literal["none", "boxes"],
        Option(
            "boxes keeps two boxes from explaining the same pixels, for look-alikes that meet; "
            "none does not (discriminative and pretrained appearance only).  If one box hides most "
            "of another, the hidden part does not count for the other.",
            compiles=True,
            needs=("appearance", "discriminative", "pretrained"),
        ),
    ] = "none",
    **options: Unpack[TrackerOptions],
) -> Any:
    """Build the tracker of ``jaxpf track``, with its defaults unless options override them.

    By default, appearance is learned from the start frame and motion is relative to object size.

    Example::

        tracker = jaxpf.boxes.tracker(frames[0], [[120, 80, 40, 90]])
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.boxes.to_boxes(tracker, summary.estimate)  # [T, P, 4]: x, y, w, h

    Options without an entry here are explained in the signature.

    Args:
        frame: uint8 RGB ``[H, W, 3]`` that contains the boxes; tracking continues with the next
            frame.  It may be None with a user-defined likelihood.
        boxes: x, y, w, h in pixels, ``[P, 4]``.
        likelihood: a user-defined likelihood of substates (u, v, a), the centre in pixels and the
            size relative to the start; or the name of a method to compute histograms.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, from which colours are learned instead of
            from the frame.
        options: ``like="smith2004"`` or ``"rowe2005"`` for that paper's system as printed, which
            other arguments override (other settings of rowe2005:
            ``jaxpf.boxes.rowe2005.rowe2005_tracker``); ``method``, ``"dps"`` (default), ``"sir"``,
            ``"ps"``, ``"sps"``, ``"labelled"``, ..., or an ``ordering`` of ``jaxpf.ordering``;
            ``num_particles``, default 300; and those of the method's filter: ``resampling``, ...
    """
    assert isinstance(boxes, Start), "by the decorator"
    steps = relative_steps(noise_relative, len(boxes.ids)) if motion == "relative" else None
    if isinstance(likelihood, str):
        looks = looks_of(frame, options.get("num_particles"), patches)
        names = [f"the box of object {number}" for number in boxes.ids]
        assert sharpness is not None, "by settle"
        if looks.background is not None:
            _check_tunable(appearance, noise_relative)
        made: Any
        if appearance == "colour":
            made = _histograms(looks, boxes, names, sharpness, bands, likelihood)
        elif appearance == "discriminative":
            about: dict[str, Any] = {} if steps is None else {"reach": reach_of(steps)}
            if looks.background is not None:
                about |= {"interpolation": "bilinear", "background_frames": looks.background}
            made = discriminative(
                looks.frame, boxes.shapes, sharpness=sharpness, names=names, **about
            )
        else:
            weights = efficientnet_lite0(network)
            made = pretrained(
                looks.frame, boxes.shapes, sharpness=sharpness, network=weights, names=names
            )
        if looks.patches is None or appearance != "colour":
            _check_contrast(looks.frame, boxes.shapes, names)
        excludes = exclusion == "boxes" and appearance != "colour"
        likelihood = excluding(made) if excludes else made
    model = box_model(likelihood, boxes.shapes, noise_pixels, steps=steps, momentum=momentum)
    return filters.build(model, **options)


def start(given: Any, names: Sequence[object] | np.ndarray | None = None) -> Start:
    """Where boxes ``[P, 4]`` start; default names are numbers from 1."""
    boxes = np.asarray(given, np.float64)
    for number, box in enumerate(boxes):
        if not (np.isfinite(box).all() and (box[2:] > 0).all()):
            raise InputError(
                f"boxes[{number}] is {box.tolist()}: give x, y, and a positive width and height."
            )
    ids = np.arange(1, len(boxes) + 1) if names is None else np.asarray(names)
    return Start(ids, boxes, boxes[:, 2:], (-1,) * len(boxes))


def settle(
    values: Mapping[str, Any], settings: Mapping[str, Any], num_objects: int | None = None
) -> dict[str, Any]:
    """By default discriminative appearance with its sharpness, and relative motion."""
    values = dict(values)
    if values["appearance"] == OPEN:
        values["appearance"] = settings.get("appearance", "discriminative")
    if values["motion"] == OPEN:
        values["motion"] = "pixels" if values["appearance"] == "colour" else "relative"
    if values["sharpness"] is None:
        values["sharpness"] = _SHARPNESS[values["appearance"]]
    if values["motion"] == "relative" and num_objects is not None:
        steps = relative_steps(values["noise_relative"], num_objects)
        values["noise_relative"] = tuple(steps.ravel().tolist())
    return values


def to_boxes(tracker: Any, estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to boxes x, y, w, h in pixels, ``[..., P, 4]``.

    Args:
        tracker: from ``tracker``.
        estimate: such as ``summary.estimate``.

    Raises:
        InputError: the tracker's dynamics do not know the sizes.
    """
    if isinstance(tracker.likelihood, PixelLikelihood):
        centre, sides = np.split(np.asarray(estimate)[..., :4], 2, axis=-1)
        return np.concatenate([centre - sides / 2, sides], axis=-1)
    sizes = getattr(tracker.dynamics, "sizes", None)
    if sizes is None:
        raise InputError(
            "this tracker's dynamics do not know the sizes of the boxes; make it with "
            "jaxpf.boxes.tracker, or use jaxpf.shapes.boxes_from_substates(estimate, sizes)."
        )
    return boxes_at(estimate, sizes)


def _histograms(
    looks: Looks, start: Start, names: list[str], sharpness: float, bands: int, method: str
) -> Any:
    settings: dict[str, Any] = {"sharpness": sharpness, "bands": bands}
    if looks.background is None:
        settings |= {"method": method, "num_particles": looks.num_particles, "names": names}
        if looks.patches is None:
            return histogram(looks.frame, start.shapes, **settings)
    else:
        settings |= {"method": "integral", "interpolation": "bilinear", "form": "ratio"}
        settings["background_frames"] = looks.background
    shape, patches = looks.frame.shape[:2], looks.patches or []
    return histogram_from_patches(patches, start.sizes, frame_shape=shape, **settings)


def _check_tunable(appearance: str, noise_relative: Sequence[float] | None) -> None:
    if len(noise_relative or ()) > 3:
        raise InputError(
            f"noise_relative {plain(noise_relative)} differs between objects, and tuning finds one "
            "motion for all; give three numbers."
        )
    if appearance == "pretrained":
        raise InputError(
            "tuning needs derivatives, which appearance pretrained lacks; choose appearance "
            "discriminative or colour."
        )


def _check_contrast(frame: np.ndarray, boxes: np.ndarray, names: Sequence[str]) -> None:
    """Refuse boxes ``[P, 4]`` of one uniform colour on a background of the same colour."""
    for name, (x, y, width, height) in zip(names, boxes, strict=True):
        left, top = (max(int(at - size / 2), 0) for at, size in ((x, width), (y, height)))
        around = frame[top : int(y + 1.5 * height) + 1, left : int(x + 1.5 * width) + 1]
        if around.size and np.ptp(around, axis=(0, 1)).max() <= _ONE_COLOUR:
            raise InputError(
                f"{name} lies on one colour, and so does what is around it, so that "
                "it cannot be located; give a box whose edges show, or another start frame."
            )
