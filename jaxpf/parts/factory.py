"""Builds trackers of articulated objects: trees of rectangles at any angle (gonzales2011).

Several objects form a forest with one root each.  A part is a partition with substate
(x, y, theta, ...): its centre in pixels and its angle in radians, clockwise in the image.  Options
and files use degrees.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from jaxpf import filters
from jaxpf.contract.model import check_tree
from jaxpf.contract.numbers import MOST
from jaxpf.contract.options import Option
from jaxpf.contract.pytree import as_array
from jaxpf.contract.types import LikelihoodLike, TrackerLike
from jaxpf.likelihoods.histogram import histogram_from_patches
from jaxpf.likelihoods.patch import patch, patch_from_pictures
from jaxpf.parts.files import Parts
from jaxpf.parts.models import cut_pictures, parts_model, with_log_odds
from jaxpf.targets.building import TrackerOptions, factory, looks_of
from jaxpf.targets.target import Looks, Start

# Samples per side of a part: the error of the likelihood is then .017 sharpness, see
# jaxpf.likelihoods._sampled.
_SAMPLES = 10
_PATCH_WINDOW = (12, 12)
#: Default slip of filmed parts, in medians of their shorter sides; see "Parts" in
#: docs/development/defaults.md.
_SLIP = 0.6
_DEGREES = (1.0, 1.0, math.pi / 180)


@factory("parts")
def tracker(
    frame: ArrayLike | Looks | None,
    parts: Parts | Start,
    *,
    likelihood: Annotated[
        Literal["auto", "sampled", "patch"] | LikelihoodLike,
        Option(
            "How likelihoods are computed: from sampled histograms (auto), or patch, which "
            "compares pixels and suits grey pictures.",
            compiles=True,
            rare=True,
        ),
    ] = "auto",
    patches: Sequence[np.ndarray] | None = None,
    sharpness: Annotated[
        float,
        Option(
            "Sharpness S of the likelihood, such as exp(-S d^2) of the colour distance d: larger "
            "trusts appearance more, and gives narrower intervals.",
            above=0,
            path="likelihood.likelihood.sharpness",
            tuned=("",),
        ),
    ] = 50.0,
    noise_pixels: Annotated[
        tuple[float, float, float],
        Option(
            "Noise per frame: x and y in pixels, and degrees, of the root or, with absolute "
            "dynamics, of every part.",
            least=0,
            path="dynamics.scale",
            factors=_DEGREES,
            tuned=("",),
        ),
    ] = (3.0, 3.0, 3.5),
    noise_joints: Annotated[
        tuple[float, float, float],
        Option(
            "Noise of a joint per frame: x and y in pixels, and degrees.",
            least=0,
            path="dynamics.joint_scale",
            factors=_DEGREES,
            tuned=("[2]",),
            needs=("dynamics", "relative"),
        ),
    ] = (0.5, 0.5, 4.5),
    bands: Annotated[
        int,
        Option(
            "Number of horizontal bands, each with a colour histogram of its own.",
            least=1,
            most=MOST,
            compiles=True,
            needs=("likelihood", "auto", "sampled"),
            rare=True,
        ),
    ] = 1,
    slip: Annotated[
        float | None,
        Option(
            "Widens the intervals: standard deviation in pixels of a part around its best match.  "
            "By default, as measured on film, 0.6 of the median shorter side; 0 in synthetic "
            "scenes.",
            least=0,
        ),
    ] = None,
    dynamics: Annotated[
        Literal["relative", "absolute"],
        Option(
            "How parts move: relative (to their parents) or absolute (each on its own).",
            compiles=True,
        ),
    ] = "relative",
    **options: Unpack[TrackerOptions],
) -> Any:
    """Build the part tracker of ``jaxpf track``.

    Example::

        parts = jaxpf.parts.Parts(
            names=("body", "arm"),
            parents=(-1, 0),
            poses=[[100, 80, 0], [110, 120, 0.3]],  # x, y, radians
            sizes=[[40, 60], [15, 50]],
        )
        tracker = jaxpf.parts.tracker(frames[0], parts)
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.parts.to_parts(tracker, summary.estimate)  # [T, P, 3]

    Options without an entry here are explained in the signature.

    Args:
        frame: uint8 RGB ``[H, W, 3]`` that contains the parts; tracking continues with the next
            frame.  It may be None with a user-defined likelihood.
        parts: tree, poses and sizes of the parts of one or several objects.
        likelihood: a user-defined likelihood of (u, v, scale, theta), or the name of a method to
            compute it.
        patches: P upright pictures, uint8 RGB ``[h, w, 3]``, from which appearance is learned
            instead of from the frame.
        options: ``like="gonzales2011"`` for that paper's system as printed, which other arguments
            override; ``method``, ``"sps"`` (default), ``"ps"`` or ``"sir"``, or an ``ordering`` of
            ``jaxpf.ordering``; ``num_particles``, default 300; and those of the method's filter:
            ``resampling``, ...
    """
    assert isinstance(parts, Start), "by the decorator"
    learned: Any = likelihood
    if isinstance(likelihood, str):
        looks = looks_of(frame, patches=patches)
        if likelihood == "patch" and looks.background is None:
            learned = _patches(looks, parts, sharpness)
        else:
            learned = _histograms(looks, parts, sharpness, bands)
        if looks.patches is None:
            learned = with_log_odds(learned, looks.frame, parts.shapes, parts.sizes, parts.parents)
            usual = _SLIP * float(np.median(parts.sizes.min(axis=1)))
            slip = looks.settings.get("slip", usual) if slip is None else slip
            learned = dataclasses.replace(learned, slip=as_array(slip, float))
    degrees = np.array(_DEGREES)
    model = parts_model(
        learned,
        parts.shapes,
        parts.sizes,
        parts.parents,
        dynamics=dynamics,
        scale=degrees * noise_pixels,
        joint_scale=degrees * noise_joints,
        reach=parts.reach,
    )
    return filters.build(model, **options)


def start(given: Parts) -> Start:
    """Where parts start."""
    poses, sizes = np.asarray(given.poses, float), np.asarray(given.sizes, float)
    return Start(np.array(given.names), poses, sizes, check_tree(given.parents))


def to_parts(tracker: TrackerLike, estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to poses x, y (pixels), theta (radians) ``[..., P, 3]``."""
    return np.asarray(estimate)[..., :3]


def _patches(looks: Looks, start: Start, sharpness: float) -> Any:
    settings: dict[str, Any] = {"sigma": 1 / math.sqrt(sharpness), "window": _PATCH_WINDOW}
    if looks.patches is not None:
        return patch_from_pictures(looks.patches, start.sizes, **settings)
    return patch(looks.frame, start.shapes, start.sizes, **settings, names=_names(start))


def _histograms(looks: Looks, start: Start, sharpness: float, bands: int) -> Any:
    settings: dict[str, Any] = {}
    if looks.background is not None:
        settings = {"interpolation": "bilinear", "form": "ratio"}
        settings["background_frames"] = looks.background
    pictures = looks.patches
    if pictures is None:
        pictures = cut_pictures(looks.frame, start.shapes, start.sizes)
    return histogram_from_patches(
        pictures,
        start.sizes,
        sharpness=sharpness,
        bands=bands,
        method="sampled",
        samples=max(_SAMPLES, 2 * bands),
        names=_names(start),
        **settings,
    )


def _names(start: Start) -> list[str]:
    """How messages show the parts."""
    return [f"part '{name}'" for name in start.ids]
