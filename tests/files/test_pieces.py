"""The pieces of a job that can resume: pieces are complete or absent, and damage is told."""

import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.files.pieces import SETTINGS, Damaged, Pieces, differences


def test_a_piece_comes_back_as_it_was_written(tmp_path):
    store = Pieces(tmp_path / "new")
    assert store.settings() is None
    store.begin({"seed": 1})
    store.write("a", {"flags": np.array([True, False]), "with a space": np.arange(3.0)})
    assert store.settings() == {"seed": 1}
    with store.opened("a") as piece:
        assert piece["flags"].tolist() == [True, False]
    store.remove()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("left", [0.0, 0.5, 0.99])
def test_a_piece_that_was_cut_off_is_one_sentence_with_the_remedy(tmp_path, left):
    store = Pieces(tmp_path, "begin anew")
    path = store.write("a", {"x": np.arange(100)})
    path.write_bytes(path.read_bytes()[: int(left * path.stat().st_size)])
    told = pytest.raises(Damaged, match=r"a\.npz' is damaged \(.*\); begin anew\.$")
    with told, store.opened("a") as piece:
        piece["x"]


def test_what_cannot_be_read_is_not_taken_for_settings(tmp_path):
    (tmp_path / SETTINGS).write_text("{")
    with pytest.raises(InputError, match=r"settings\.json' cannot be read"):
        Pieces(tmp_path).settings()


def test_differences_are_told_by_name_with_both_values():
    old, new = {"seed": 0, "grid": {"n": (1, 2)}}, {"seed": 0, "grid": {"n": (1,)}, "more": None}
    assert list(differences(old, new)) == ["grid: n = 1,2, now 1"]
