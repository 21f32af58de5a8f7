"""Frames of long recordings: as an array's, but read when they are asked for."""

import pickle

import numpy as np
import pytest
from small_video import LENGTH, picture, write_lossless_video

from jaxpf import InputError
from jaxpf.evaluation.scene import load_scene
from jaxpf.sequences import sequence as sequences
from jaxpf.sequences.frames import Frames

META = '{{"name": "a", "frames": "{}", "n_frames": {}, "width": 64, "height": 48, "fps": 10}}'


@pytest.fixture
def folder(tmp_path):
    write_lossless_video(tmp_path / "clip.avi", [picture(t) for t in range(LENGTH)])
    (tmp_path / "meta.json").write_text(META.format("clip.avi", LENGTH))
    rows = [f"{t},1,3,4,20,20,0" for t in range(LENGTH)]
    (tmp_path / "gt.csv").write_text("\n".join(["frame,id,x,y,w,h,occ", *rows]))
    return tmp_path


@pytest.fixture
def both(folder, monkeypatch):
    """The same frames, from the second one on, as an array and lazily."""
    kept = load_scene(folder, start_frame=1)
    monkeypatch.setattr(sequences, "MOST_KEPT", kept.frames.nbytes - 1)
    lazy = load_scene(folder, start_frame=1)
    assert isinstance(kept.frames, np.ndarray)
    assert isinstance(lazy.frames, Frames)
    np.testing.assert_array_equal(lazy.patches[0], kept.patches[0])
    return kept.frames, lazy.frames


@pytest.mark.parametrize(
    "index",
    [
        *(np.s_[3], np.s_[-1], np.s_[1:], np.s_[2:7:2], np.s_[::-2], np.s_[5:5], np.s_[...]),
        *(np.s_[4, :3], np.s_[2:4, 5, ::2], np.s_[:, 1], np.s_[..., 0], [0, 5, 2, 5]),
        *(np.array([2, 0]), np.arange(LENGTH - 1) % 2 == 0, np.array([[0, 1], [3, 2]])),
    ],
    ids=str,
)
def test_indices_mean_what_they_mean_for_an_array(both, index):
    kept, lazy = both
    found = lazy[index]
    assert found.shape == kept[index].shape
    assert found.dtype == np.uint8
    np.testing.assert_array_equal(np.asarray(found), kept[index])


def test_frames_come_in_any_order_one_after_another_and_in_another_process(both):
    kept, lazy = both
    assert (lazy.shape, lazy.ndim, lazy.nbytes) == (kept.shape, kept.ndim, kept.nbytes)
    for place in (0, 1, 2, 5, 4, 8, 8, 0):
        np.testing.assert_array_equal(lazy[place], kept[place])
    one, other = iter(lazy), iter(lazy)  # neither disturbs the other
    for frame in kept:
        np.testing.assert_array_equal(next(one), frame)
    np.testing.assert_array_equal(next(other), kept[0])
    np.testing.assert_array_equal(np.stack(list(pickle.loads(pickle.dumps(lazy))[2:])), kept[2:])
    for place in (9, -10):
        with pytest.raises(IndexError):
            lazy[place]


def test_nothing_is_read_that_nobody_asked_for(both, folder):
    _, lazy = both
    (folder / "clip.avi").unlink()
    part = lazy[2:][1:4]
    assert (len(part), part.shape[1:]) == (3, (48, 64, 3))
    with pytest.raises(InputError):
        part[0]


def test_a_video_that_is_too_short_is_told_where_it_ends(folder, monkeypatch):
    (folder / "meta.json").write_text(META.format("clip.avi", LENGTH + 1))
    monkeypatch.setattr(sequences, "MOST_KEPT", 1)
    lazy = load_scene(folder).frames
    for read in (lambda: list(lazy), lambda: lazy[LENGTH], lambda: lazy[LENGTH]):
        with pytest.raises(InputError, match=f"frame {LENGTH}"):
            read()
    np.testing.assert_array_equal(lazy[1], picture(1))
