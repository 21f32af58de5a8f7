"""Which names a refused name may have meant."""

import difflib
from collections.abc import Collection

#: Names before version 0.1.0, and those that took their place, of which the known one is meant.
RENAMED = {
    "bend_noise": ("noise_bend",),
    "birth_confidence": ("detection_confidence",),
    "birth_frames": ("min_hits",),
    "birth_overlap": ("detection_iou",),
    "births": ("detections",),
    "born": ("add_target",),
    "death_frames": ("max_age",),
    "detect_every": ("detection_interval",),
    "detection_scale": ("detection_noise",),
    "detections": ("to_supervision",),
    "diffusion": ("noise_points",),
    "ended": ("remove_target",),
    "gain": ("sharpness",),
    "homes": ("assign_slots",),
    "joint_scale": ("noise_joints",),
    "likelihood.gain": ("likelihood.sharpness",),
    "look_ahead": ("joint_weighting",),
    "nobody": ("start_empty",),
    "overlap": ("iou",),
    "overlap_loss": ("iou_loss",),
    "OVERLAP_THRESHOLDS": ("IOU_THRESHOLDS",),
    "pairwise_overlap": ("pairwise_iou",),
    "particles": ("num_particles",),
    "parts": ("bands",),
    "parts_file": ("parts",),
    "populations": ("detections",),
    "relative_scale": ("noise_relative",),
    "resampled": ("resample_polyline",),
    "scale": ("noise_pixels", "noise_points"),
    "shapes": ("to_boxes", "to_points", "to_parts", "to_contours"),
    "shift_noise": ("noise_shift",),
    "STATUS_LOST": ("STATUS_WITHOUT_LIKELIHOOD",),
    "success_area": ("success_auc",),
    "success_at_half": ("success_rate_50",),
    "success_half": ("success_rate_50",),
    "transforms": ("pit_values",),
    "turned": ("rotate",),
    "uniqueness": ("distinct_share",),
    "varied": ("augment",),
}


def renamed(name: str, known: Collection[str]) -> list[str]:
    """The known names, or flags, that took the place of an earlier one."""
    new = RENAMED.get(name.removeprefix("--").replace("-", "_"), ())
    return [each for each in (*new, *(f"--{n.replace('_', '-')}" for n in new)) if each in known]


def resembling(name: str, known: Collection[str], most: int = 1, cutoff: float = 0.6) -> list[str]:
    """The known names that took the place of a refused one, or else look like it.

    Args:
        name: the refused name.
        known: valid names.
        most: number of names that look like it.
        cutoff: how much they must look like it, from 0 to 1.
    """
    return renamed(name, known) or difflib.get_close_matches(name, known, n=most, cutoff=cutoff)
