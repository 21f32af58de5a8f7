"""Standard benchmark scores: CLEAR-MOT, IDF1, HOTA, and OTB's curves.

CLEAR-MOT, IDF1 and HOTA are computed by TrackEval (``pip install --no-deps trackeval``), so they
match the benchmarks.  Boxes are x, y, w, h in pixels; a box that is not finite or has no width or
height stands for an absent object.
"""

import contextlib
import importlib
import io
from types import ModuleType

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import with_nan
from jaxpf.measures.association import pairwise_iou
from jaxpf.measures.metrics import iou, masked_mean
from jaxpf.shapes.rectangles import is_proper

#: IoU thresholds of the success curve (wu2013): 0, .05, ..., 1.
IOU_THRESHOLDS = np.arange(21) / 20
#: Centre errors of the precision curve (wu2013), in pixels: 0, 1, ..., 50.
CENTRE_THRESHOLDS = np.arange(51)

_SHARES = ("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1", "IDR", "IDP")
_COUNTS = {
    **{"TP": "CLR_TP", "FP": "CLR_FP", "FN": "CLR_FN"},
    **{name: name for name in ("IDSW", "Frag", "MT", "PT", "ML")},
}


def tracking_scores(estimate: ArrayLike, truth: ArrayLike) -> dict[str, float]:
    """The MOTChallenge's scores of one run, computed by TrackEval.

    Each column is one identity.  HOTA, IDF1 and identity switches measure whether a track stays on
    one object, whichever that is.  Unlike the benchmark, which removes tracks of static people, no
    boxes are filtered: the truth should hold only objects to be tracked.

    Args:
        estimate: boxes ``[T, P, 4]`` of P tracks.
        truth: boxes ``[T, Q, 4]`` of Q objects.

    Returns:
        Shares: ``HOTA``, ``DetA``, ``AssA``, ``LocA`` (luiten2021; means over the IoUs .05, .1,
        ..., .95, LocA's over those at which a box matches), ``MOTA`` and ``MOTP`` (bernardin2008;
        MOTA can be negative, MOTP is the mean IoU of matches), ``IDF1``, ``IDR`` and ``IDP``
        (ristani2016); NaN without any truth, and LocA without any match.
        Counts: ``TP``, ``FP`` and ``FN``, boxes; ``IDSW``, identity switches; ``Frag``,
        interruptions; ``MT``, ``PT`` and ``ML``, objects tracked in more than 80%, in 20 to 80%,
        and in less than 20% of their frames.  A box matches at an IoU of .5 or more.

    Raises:
        InputError: TrackEval is not installed, or the shapes do not match.
    """
    truth = np.asarray(with_nan(truth), float)
    estimate = np.asarray(with_nan(estimate), float)
    metrics = import_trackeval().metrics
    data = _trackeval_data(estimate, truth)
    quiet = {"PRINT_CONFIG": False}
    results = metrics.HOTA().eval_sequence(data)
    results |= metrics.CLEAR(quiet).eval_sequence(data) | metrics.Identity(quiet).eval_sequence(
        data
    )
    # TrackEval calls the localisation perfect where nothing matches, 0 of 0.
    matches = results["HOTA_TP"] > 0
    results["LocA"] = results["LocA"][matches] if matches.any() else np.nan
    scores = {name: float(np.mean(results[name])) for name in _SHARES}
    if data["num_gt_dets"] == 0:
        scores = dict.fromkeys(_SHARES, float("nan"))
    return scores | {name: float(results[field]) for name, field in _COUNTS.items()}


def success_curve(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """Share of frames whose IoU exceeds each of ``IOU_THRESHOLDS`` (wu2013).

    As in the benchmark, the IoU must *exceed* the threshold, so a perfect tracker has 0 at the
    threshold 1 and an area of 20/21.  Frames without truth do not count; frames without an
    estimate count as misses.

    Args:
        estimate: ``[..., T, P, 4]`` boxes; leading axes broadcast.
        truth: ``[..., T, P, 4]`` boxes.

    Returns:
        ``[..., P, 21]``; NaN for an object without truth.
    """
    ious = iou(estimate, truth)
    exceeds = ious[..., None] > jnp.asarray(IOU_THRESHOLDS, ious.dtype)
    counts = jnp.broadcast_to(is_proper(truth)[..., None], exceeds.shape)
    return masked_mean(exceeds.astype(ious.dtype), counts, -3)


def success_auc(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[..., P]``: AUC of ``success_curve``, which is the mean of its 21 values (wu2013)."""
    return jnp.mean(success_curve(estimate, truth), axis=-1)


def success_rate_50(estimate: ArrayLike, truth: ArrayLike) -> Array:
    """``[..., P]``: success rate at IoU 0.5, the share of frames whose IoU exceeds 0.5."""
    return success_curve(estimate, truth)[..., len(IOU_THRESHOLDS) // 2]


def import_trackeval() -> ModuleType:
    """Import TrackEval; call this early, before long work that needs scores.

    Raises:
        InputError: TrackEval is not installed.
    """
    try:
        # TrackEval prints a line for each benchmark with missing packages; none is needed here.
        with contextlib.redirect_stdout(io.StringIO()):
            return importlib.import_module("trackeval")
    except ImportError as error:
        raise InputError(
            f"CLEAR-MOT, IDF1 and HOTA need TrackEval ({error}); install it with pip install "
            "--no-deps trackeval."
        ) from error


# Helpers


def _trackeval_data(estimate: np.ndarray, truth: np.ndarray) -> dict:
    """Input of TrackEval's metrics: the present ids in each frame and their IoUs."""
    tracks, objects = _present(estimate), _present(truth)
    # Ids count from 0 without gaps; identities that never appear get none.
    track_ids, object_ids = (np.cumsum(there.any(axis=0)) - 1 for there in (tracks, objects))
    return {
        "num_timesteps": len(truth),
        "num_gt_ids": int(objects.any(axis=0).sum()),
        "num_tracker_ids": int(tracks.any(axis=0).sum()),
        "num_gt_dets": int(objects.sum()),
        "num_tracker_dets": int(tracks.sum()),
        "gt_ids": [object_ids[there] for there in objects],
        "tracker_ids": [track_ids[there] for there in tracks],
        "similarity_scores": [
            pairwise_iou(truth[t, objects[t]], estimate[t, tracks[t]]) for t in range(len(truth))
        ],
    }


def _present(boxes: np.ndarray) -> np.ndarray:
    """``[T, P]`` bool: whether a box is finite and has a width and a height."""
    return np.isfinite(boxes).all(axis=-1) & (boxes[..., 2:] > 0).all(axis=-1)
