import ast
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import scenes
from scenes import DistracterParameters, SceneError

SMALL = {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}


def crop(frame, box):
    """The pixels of a box, at the nearest whole pixel."""
    left, top = np.floor(box[:2] + 0.5).astype(int)
    return frame[top : top + int(box[3]), left : left + int(box[2])]


def hue_histograms(patch):
    """A joint hue and saturation histogram of the top and of the bottom half."""
    hsv = cv2.cvtColor(patch.astype(np.float32) / 255, cv2.COLOR_RGB2HSV)
    half = len(patch) // 2
    histograms = []
    for part in (hsv[:half], hsv[half:]):
        counts = np.histogram2d(
            part[..., 0].ravel(), part[..., 1].ravel(), bins=10, range=[[0, 360], [0, 1]]
        )[0]
        histograms.append(counts / counts.sum())
    return histograms


def squared_distance(one, other):
    """Bhattacharyya's d^2 summed over the halves: 0 alike, 2 nothing in common."""
    pairs = zip(hue_histograms(one), hue_histograms(other), strict=True)
    return sum(1 - np.sqrt(p * q).sum() for p, q in pairs)


def boxes_gap(one, other):
    """The larger of the gaps in x and in y, negative if the boxes meet."""
    start, end = one[..., :2], one[..., :2] + one[..., 2:]
    start2, end2 = other[..., :2], other[..., :2] + other[..., 2:]
    return np.max(np.maximum(start, start2) - np.minimum(end, end2), axis=-1)


@pytest.fixture(scope="module")
def scene():
    return scenes.make("distracter", seed=1)


def test_scenes_import_nothing_of_the_library():
    for path in Path(scenes.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                imported = [node.module or ""]
            else:
                continue
            assert not any(name.split(".")[0] in ("jaxpf", "jax") for name in imported), path


def test_unknown_names_parameters_and_seeds_are_refused_with_the_valid_ones():
    assert "distracter" in scenes.names()
    with pytest.raises(SceneError, match=r"'nothing'.*distracter"):
        scenes.make("nothing")
    with pytest.raises(SceneError, match=r"'lambda'.*num_frames.*likeness"):
        scenes.make("distracter", **{"lambda": 20})
    with pytest.raises(SceneError, match="seed = -1"):
        scenes.make("distracter", seed=-1)
    with pytest.raises(SceneError, match=r"seed = 0\.5"):
        scenes.make("distracter", seed=0.5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("likeness", 1.5),
        ("num_objects", 0),
        ("motion_scale", -1.0),
        ("vanish_frame", 3),
        ("background_change", "sometimes"),
        ("num_frames", "many"),
        ("brightness", float("nan")),
    ],
)
def test_parameters_out_of_range_are_refused(name, value):
    with pytest.raises(SceneError, match=f"{name} = "):
        scenes.make("distracter", **{name: value})


def test_a_crowd_that_does_not_fit_is_refused_with_a_remedy():
    with pytest.raises(SceneError, match="fewer or smaller objects"):
        scenes.make("distracter", num_objects=60)


def test_parameters_tell_how_to_make_the_scene_again():
    first = scenes.make("distracter", seed=np.int64(5), **SMALL)
    assert first.parameters["seed"] == 5
    assert first.parameters["num_objects"] == 3
    assert json.loads(json.dumps(first.parameters)) == first.parameters
    again = scenes.make("distracter", **first.parameters)
    np.testing.assert_array_equal(again.frames, first.frames)
    np.testing.assert_array_equal(again.boxes, first.boxes)
    for one, other in zip(again.patches, first.patches, strict=True):
        np.testing.assert_array_equal(one, other)


def test_another_seed_is_another_scene():
    one, other = (scenes.make("distracter", seed=seed, **SMALL) for seed in (0, 1))
    assert not np.array_equal(one.boxes, other.boxes)
    assert not np.array_equal(one.frames, other.frames)


def test_pixel_noise_does_not_change_the_trajectories():
    calm = scenes.make("distracter", object_noise=0.0, **SMALL)
    noisy = scenes.make("distracter", object_noise=30.0, **SMALL)
    np.testing.assert_array_equal(calm.boxes, noisy.boxes)
    assert not np.array_equal(calm.frames, noisy.frames)


def test_the_defaults_are_those_of_the_paper(scene):
    assert scene.frames.shape == (25, 288, 360, 3)
    assert scene.frames.dtype == np.uint8
    assert scene.boxes.shape == (25, 7, 4)
    assert scene.num_objects == 7
    np.testing.assert_array_equal(scene.sizes, [[32, 42]] * 7)
    # "Appears in frame 3 and disappears in frame 9", counted from 1: drawn in 3, ..., 8.
    shown = np.isfinite(scene.extras["distracter_boxes"]).all(axis=1)
    assert (np.nonzero(shown)[0] + 1).tolist() == [3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize("seed", range(5))
def test_objects_stay_in_view_and_apart(seed):
    scene = scenes.make("distracter", seed=seed)
    left_top, right_bottom = scene.boxes[..., :2], scene.boxes[..., :2] + scene.boxes[..., 2:]
    assert (left_top >= 2).all()
    assert (right_bottom <= np.array([360, 288]) - 2).all()
    for one in range(7):
        for other in range(one):
            assert (boxes_gap(scene.boxes[:, one], scene.boxes[:, other]) >= 6 - 1e-9).all()
    shown = scene.extras["distracter_boxes"]
    for other in range(1, 7):
        assert np.nanmin(boxes_gap(shown, scene.boxes[:, other])) >= 6 - 1e-9


def test_the_distracter_covers_object_1_then_leads_away_in_a_straight_line():
    scene = scenes.make("distracter", seed=2, lead_distance=50.0)
    shown = scene.extras["distracter_boxes"][2:8]
    np.testing.assert_allclose(shown[0], scene.boxes[2, 0])
    # It ends 50 pixels away, on the far side of where object 1 came from.
    moved = scene.boxes[7, 0, :2] - scene.boxes[2, 0, :2]
    gap = shown[-1, :2] - scene.boxes[7, 0, :2]
    np.testing.assert_allclose(np.hypot(*gap), 50)
    np.testing.assert_allclose(gap @ moved, -50 * np.hypot(*moved))
    assert np.hypot(*moved) >= scene.parameters["leader_travel"]
    steps = np.diff(shown[:, :2], axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to(steps[0], steps.shape), atol=1e-9)


def test_object_1_departs_from_where_the_distracter_vanished():
    distances = {}
    for departure in (0.0, 60.0):
        scene = scenes.make("distracter", seed=3, lead_distance=25.0, departure=departure)
        vanished = scene.extras["distracter_boxes"][7, :2]
        distances[departure] = np.hypot(*(scene.boxes[-1, 0, :2] - vanished))
    assert distances[0.0] < 60 <= distances[60.0]


def test_the_direction_of_the_lead_can_be_chosen():
    scene = scenes.make("distracter", seed=2, lead_direction=90.0, lead_distance=45.0)
    gap = scene.extras["distracter_boxes"][7, :2] - scene.boxes[7, 0, :2]
    np.testing.assert_allclose(gap, [0, 45], atol=1e-9)


def test_the_frames_show_what_the_truth_says():
    scene = scenes.make("distracter", seed=3, object_noise=0.0)
    shown = scene.extras["distracter_boxes"]
    for frame in range(scene.num_frames):
        for number in range(1, 7):
            seen = crop(scene.frames[frame], scene.boxes[frame, number])
            np.testing.assert_array_equal(seen, scene.patches[number])
        if np.isfinite(shown[frame]).all():
            seen = crop(scene.frames[frame], shown[frame])
            np.testing.assert_array_equal(seen, scene.extras["distracter_patch"])
        else:
            seen = crop(scene.frames[frame], scene.boxes[frame, 0])
            np.testing.assert_array_equal(seen, scene.extras["object_patch"])


def test_motion_is_autoregressive_with_the_stated_noise():
    # One small object in a wide frame and no distracter: nothing is ever redrawn.
    shape = {"frame_width": 300, "frame_height": 300, "object_width": 4, "object_height": 4}
    steps = []
    for seed in range(20):
        scene = scenes.make(
            "distracter",
            seed=seed,
            **{"num_objects": 1, "num_frames": 30, "start_jitter": 0.0, **shape},
            **{"appear_frame": 50, "vanish_frame": 51},
        )
        steps.append(np.diff(scene.boxes[:, 0, :2], axis=0))
    before = np.concatenate([track[:-1] for track in steps]).ravel()
    after = np.concatenate([track[1:] for track in steps]).ravel()
    # Standard errors with 20 * 28 * 2 = 1120 steps: of the momentum sqrt((1 - .25) / 1120) =
    # .026, of the noise 3 / sqrt(2 * 1120) = .063.
    momentum = (before @ after) / (before @ before)
    assert abs(momentum - 0.5) < 0.1
    assert abs(np.std(after - 0.5 * before) - 3) < 0.25


def test_the_first_template_prefers_the_distracter_and_then_object_1(scene):
    template = scene.patches[0]
    to_distracter = squared_distance(template, scene.extras["distracter_patch"])
    to_object = squared_distance(template, scene.extras["object_patch"])
    background = scenes.make("distracter", seed=1, num_objects=1).frames[-1][:42, :32]
    others = [squared_distance(template, patch) for patch in scene.patches[1:]]
    assert to_distracter < 0.05
    assert to_distracter + 0.1 < to_object
    assert to_object + 0.2 < min(others)
    assert to_object + 0.3 < squared_distance(template, background)


def test_every_object_matches_its_own_template_best(scene):
    for number in range(1, 7):
        seen = crop(scene.frames[-1], scene.boxes[-1, number])
        distances = [squared_distance(seen, patch) for patch in scene.patches]
        assert np.argmin(distances) == number
        assert sorted(distances)[1] > distances[number] + 0.3
        upside_down = np.concatenate([seen[21:], seen[:21]])
        assert squared_distance(upside_down, scene.patches[number]) > 1


@pytest.mark.parametrize("likeness", [0.0, 0.5, 1.0])
def test_likeness_is_the_share_of_common_colour(likeness):
    scene = scenes.make("distracter", likeness=likeness, object_noise=0.0, **SMALL)
    same = (scene.extras["distracter_patch"] == scene.extras["object_patch"]).all(axis=-1)
    # Whole cells of 4 x 4, some cut at the edge of a half: not exact to the pixel.
    assert abs(same.mean() - likeness) < 0.04
    assert abs(same[:21].mean() - same[21:].mean()) < 0.08


@pytest.mark.parametrize(("share", "source"), [(0.0, "object_patch"), (1.0, "distracter_patch")])
def test_the_first_template_can_be_learned_from_either(share, source):
    scene = scenes.make("distracter", template_from_distracter=share, **SMALL)
    np.testing.assert_array_equal(scene.patches[0], scene.extras[source])


def test_background_changes_only_when_asked():
    corner = (slice(None), slice(0, 2), slice(0, 2))
    still = scenes.make("distracter", **SMALL).frames[corner]
    lively = scenes.make("distracter", background_change="every frame", **SMALL).frames[corner]
    assert (still == still[0]).all()
    assert all((picture != lively[0]).any() for picture in lively[1:])


def test_background_noise_is_as_stated():
    scene = scenes.make("distracter", background_mean=120.0, background_noise=20.0, **SMALL)
    # The margin of 2 pixels is free of objects.
    pixels = np.concatenate([scene.frames[0, :2].ravel(), scene.frames[0, -2:].ravel()])
    # 2160 values: standard errors 20 / sqrt(2160) = .43 and .30.
    assert abs(pixels.mean() - 120) < 2
    assert abs(pixels.std() - 20) < 1.5
    coarse = scenes.make("distracter", background_grain=2, **SMALL).frames[0]
    np.testing.assert_array_equal(coarse[0], coarse[1])


def test_parameters_cannot_be_changed_after_the_fact():
    with pytest.raises(AttributeError):
        DistracterParameters().likeness = 0.1


def test_a_scene_whose_parts_do_not_match_is_refused():
    frames, boxes = np.zeros((3, 8, 9, 3), np.uint8), np.zeros((3, 1, 4))
    patches = [np.zeros((2, 4, 3), np.uint8)]
    good = scenes.Scene("test", frames, boxes, patches, 25.0, {})
    np.testing.assert_array_equal(good.sizes, [[4, 2]])
    with pytest.raises(SceneError, match="uint8"):
        scenes.Scene("test", frames.astype(float), boxes, patches, 25.0, {})
    with pytest.raises(SceneError, match="one row per frame"):
        scenes.Scene("test", frames, boxes[:2], patches, 25.0, {})
    with pytest.raises(SceneError, match="reference patches"):
        scenes.Scene("test", frames, boxes, [], 25.0, {})


# Real clips, first on a folder made here


HEADER = "frame,id,x,y,w,h,occ\n"


@pytest.fixture
def folder(tmp_path):
    """Three pictures of 12 x 8; object 2 in all of them, object 7 in the last two."""
    (tmp_path / "frames").mkdir()
    for number in range(3):
        picture = np.zeros((8, 12, 3), np.uint8)
        picture[..., 0] = 50 * (number + 1)  # red
        picture[..., 2] = np.arange(12)  # blue
        cv2.imwrite(str(tmp_path / "frames" / f"{number:04d}.png"), picture[..., ::-1])
    meta = {"name": "made", "frames": "frames/%04d.png", "n_frames": 3, "width": 12, "height": 8}
    (tmp_path / "meta.json").write_text(json.dumps({**meta, "fps": 10}))
    (tmp_path / "gt.csv").write_text(
        HEADER + "0,2,1,2,3,4,0\n1,7,8.5,1,6,5,-1\n1,2,2,2,3,4,1\n2,2,3,2,3,4,2\n2,7,0,0,2,2,0\n"
    )
    return tmp_path


def test_a_clip_is_read_with_gaps_where_an_object_has_no_line(folder):
    clip = scenes.read_clip(folder)
    assert (clip.name, clip.ids, clip.num_frames, clip.fps) == ("made", (2, 7), 3, 10)
    assert np.isnan(clip.boxes[0, 1]).all()
    np.testing.assert_array_equal(clip.boxes[:, 0], [[1, 2, 3, 4], [2, 2, 3, 4], [3, 2, 3, 4]])
    np.testing.assert_array_equal(clip.boxes[1:, 1], [[8.5, 1, 6, 5], [0, 0, 2, 2]])
    np.testing.assert_array_equal(clip.occlusion, [[0, -1], [1, -1], [2, 0]])


def test_a_clip_decodes_pictures_to_rgb_only_when_asked(folder):
    clip = scenes.read_clip(folder)
    (folder / "frames" / "0002.png").unlink()
    pictures = clip.frames()
    first = next(pictures)
    np.testing.assert_array_equal(first[0, :, 0], [50] * 12)
    np.testing.assert_array_equal(first[0, :, 2], np.arange(12))
    next(pictures)
    with pytest.raises(SceneError, match="frame 2 is missing"):
        next(pictures)


def test_a_loaded_clip_is_a_scene(folder):
    scene = scenes.read_clip(folder).load()
    assert scene.frames.shape == (3, 8, 12, 3)
    # Object 2 from frame 0: columns 1 to 3, rows 2 to 5.
    np.testing.assert_array_equal(scene.patches[0], scene.frames[0, 2:6, 1:4])
    # Object 7 from frame 1: from column 8 (8.5 rounds to even) to the border at 12, rows 1 to 5.
    np.testing.assert_array_equal(scene.patches[1], scene.frames[1, 1:6, 8:12])
    np.testing.assert_array_equal(scene.extras["ids"], [2, 7])


def test_objects_of_a_clip_can_be_chosen(folder):
    clip = scenes.read_clip(folder)
    scene = clip.load(ids=[7])
    np.testing.assert_array_equal(scene.boxes, clip.boxes[:, 1:])
    np.testing.assert_array_equal(scene.extras["occlusion"], clip.occlusion[:, 1:])
    assert len(scene.patches) == 1
    with pytest.raises(SceneError, match="no object 3; its ids are 2, 7"):
        clip.load(ids=[2, 3])


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("1,2,3", "3 values, not 7"),
        ("1,2,a,2,3,4,0", "x = 'a' is not a finite number"),
        ("1,2,nan,2,3,4,0", "x = 'nan' is not a finite number"),
        ("1.5,2,3,2,3,4,0", "frame = '1.5' is not a whole number"),
        ("3,2,3,2,3,4,0", r"frame must lie in 0\.\.2"),
        ("1,2,3,2,0,4,0", "w and h must be above 0"),
        ("1,2,3,2,3,4,5", "occ must be"),
        ("0,2,3,2,3,4,0", "second box for object 2 in frame 0"),
    ],
)
def test_a_malformed_line_is_named(folder, line, complaint):
    (folder / "gt.csv").write_text(HEADER + "0,2,1,2,3,4,0\n" + line + "\n")
    with pytest.raises(SceneError, match=f"gt.csv, line 3: '{line}'.*{complaint}"):
        scenes.read_clip(folder)


def test_missing_files_are_named(folder):
    with pytest.raises(SceneError, match="no such folder"):
        scenes.read_clip(folder / "nowhere")
    (folder / "gt.csv").rename(folder / "truth.csv")
    with pytest.raises(SceneError, match=r"gt\.csv is missing"):
        scenes.read_clip(folder)
    (folder / "truth.csv").rename(folder / "gt.csv")
    (folder / "frames" / "0000.png").unlink()
    with pytest.raises(SceneError, match=r"0000\.png is missing"):
        scenes.read_clip(folder)
    (folder / "meta.json").unlink()
    with pytest.raises(SceneError, match=r"meta\.json is missing"):
        scenes.read_clip(folder)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"n_frames": None}, "n_frames = None"),
        ({"n_frames": 2.5}, r"n_frames = 2\.5"),
        ({"fps": 0}, "fps = 0"),
        ({"name": 3}, "name = 3 must be text"),
    ],
)
def test_a_wrong_description_is_named(folder, change, complaint):
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | change))
    with pytest.raises(SceneError, match=complaint):
        scenes.read_clip(folder)


def test_wrong_json_and_a_wrong_header_are_named(folder):
    (folder / "gt.csv").write_text("frame,id,x,y\n0,2,1,2\n")
    with pytest.raises(SceneError, match="line 1: the header must be 'frame,id,x,y,w,h,occ'"):
        scenes.read_clip(folder)
    (folder / "meta.json").write_text("{")
    with pytest.raises(SceneError, match="not valid JSON"):
        scenes.read_clip(folder)


def test_pictures_of_another_size_than_described_are_refused(folder):
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | {"width": 13}))
    with pytest.raises(SceneError, match="frame 0 measures 12 x 8"):
        scenes.read_clip(folder).load()


def test_a_video_that_ends_early_is_refused(folder):
    writer = cv2.VideoWriter(
        str(folder / "video.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48)
    )
    if not writer.isOpened():
        pytest.skip("this build of OpenCV writes no MJPG video")
    for _ in range(2):
        writer.write(np.full((48, 64, 3), 90, np.uint8))
    writer.release()
    meta = json.loads((folder / "meta.json").read_text())
    meta |= {"frames": "video.avi", "width": 64, "height": 48}
    (folder / "meta.json").write_text(json.dumps(meta))
    clip = scenes.read_clip(folder)
    with pytest.raises(SceneError, match="ends after 2 frames"):
        list(clip.frames())
    (folder / "meta.json").write_text(json.dumps(meta | {"n_frames": 2}))
    (folder / "gt.csv").write_text(HEADER + "0,2,1,2,3,4,0\n")
    assert len(list(scenes.read_clip(folder).frames())) == 2


def test_a_real_walk_through_a_campus(data_folder):
    scene = scenes.read_clip(data_folder / "tud_campus").load(ids=[1, 2, 3, 4, 5])
    assert scene.frames.shape == (71, 480, 640, 3)
    np.testing.assert_array_equal(scene.boxes[0, 0], [398, 181, 121, 229])
    np.testing.assert_array_equal(scene.sizes[0], [121, 229])


def test_every_annotated_real_clip_can_be_opened(data_folder):
    folders = [path.parent for path in sorted(data_folder.glob("*/gt.csv"))]
    assert folders
    for path in folders:
        clip = scenes.read_clip(path)
        assert np.isfinite(clip.boxes).all(axis=-1).any(axis=0).all(), path
        assert next(clip.frames()).shape == (clip.height, clip.width, 3)
