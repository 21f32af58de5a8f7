"""A name of an earlier version is refused with the one that took its place."""

import pytest
from command_line import refusal_of
from refusals import message_of

import jaxpf
from jaxpf._resembling import renamed

#: Options of models, filters and ``jaxpf track``: kind of target, old name, new name.
OPTIONS = [
    ("boxes", "scale", "noise_pixels"),
    ("boxes", "relative_scale", "noise_relative"),
    ("parts", "joint_scale", "noise_joints"),
    ("points", "diffusion", "noise_points"),
    ("contours", "shift_noise", "noise_shift"),
    ("contours", "bend_noise", "noise_bend"),
    ("boxes", "gain", "sharpness"),
    ("boxes", "particles", "num_particles"),
    ("contours", "look_ahead", "joint_weighting"),
    ("parts", "parts_file", "parts"),
    ("boxes", "births", "detections"),
    ("boxes", "birth_frames", "min_hits"),
    ("boxes", "death_frames", "max_age"),
    ("boxes", "birth_overlap", "detection_iou"),
    ("boxes", "birth_confidence", "detection_confidence"),
    ("boxes", "detect_every", "detection_interval"),
    ("boxes", "detection_scale", "detection_noise"),
]
POINTS = [[120.5, 80.0], [200.0, 90.0]]


@pytest.mark.parametrize(("kind", "old", "new"), OPTIONS)
def test_a_flag_and_a_key_are_refused_with_the_new_name(kind, old, new, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flag, new_flag = (f"--{name.replace('_', '-')}" for name in (old, new))
    assert f"{flag}; did you mean {new_flag}?" in refusal_of("track", kind, "clip.mp4", flag, 1)
    (tmp_path / "run.toml").write_text(f"[track]\n{old} = 1")
    sentence = refusal_of("track", kind, "clip.mp4", "--config", "run.toml")
    assert f"'{old}' in [track]" in sentence
    assert f"did you mean '{new}'?" in sentence


def test_what_is_called_is_refused_with_its_new_name():
    old = {"target": "boxes", "grid": {"particles": [1]}}
    assert "num_particles" in message_of(jaxpf.evaluation.Plan, "scene", **old)
    assert "num_particles" in message_of(jaxpf.points.tracker, None, POINTS, particles=9)


def test_only_a_known_name_takes_the_place():
    assert renamed("--particles", ["num_particles", "runs"]) == ["num_particles"]
    assert renamed("particles", ["runs"]) == renamed("run", ["runs"]) == []


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        *((getattr(jaxpf, kind), "shapes", f"to_{kind}")
          for kind in ("boxes", "points", "parts", "contours")),
        (jaxpf, "populations", "detections"),
        (jaxpf.boxes, "detections", "to_supervision"),
        (jaxpf.contract, "STATUS_LOST", "STATUS_WITHOUT_LIKELIHOOD"),
        (jaxpf.detections, "nobody", "start_empty"),
        (jaxpf.filters, "born", "add_target"),
        (jaxpf.filters, "ended", "remove_target"),
        (jaxpf.filters, "homes", "assign_slots"),
        (jaxpf.measures, "overlap", "iou"),
        (jaxpf.measures, "pairwise_overlap", "pairwise_iou"),
        (jaxpf.measures, "success_area", "success_auc"),
        (jaxpf.measures, "success_at_half", "success_rate_50"),
        (jaxpf.measures, "transforms", "pit_values"),
        (jaxpf.measures, "uniqueness", "distinct_share"),
        (jaxpf.tuning, "overlap_loss", "iou_loss"),
        (jaxpf.shapes, "turned", "rotate"),
        (jaxpf.shapes, "resampled", "resample_polyline"),
        (jaxpf.shapes, "varied", "augment"),
    ],
)  # fmt: skip
def test_a_public_name_is_refused_with_its_new_name(module, old, new):
    with pytest.raises(AttributeError, match=f"{old!r}; did you mean {new!r}"):
        getattr(module, old)
