"""The store of jobs that resume: pieces are complete or absent, and damage is told.

Evaluations, papers, tuning and long scans keep their pieces in it; ``test_round_trips.py`` reads
what was written.
"""

import numpy as np
import pytest
from refusals import message_of

from jaxpf import InputError
from jaxpf.files.store import SETTINGS, Damaged, Store, differences

ARRAYS = {"x": np.arange(100.0), "flags": np.arange(9) % 2 == 0}


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "new", "begin anew")


def read(store):
    with store.opened("a") as piece:
        return {name: piece[name] for name in ARRAYS}


def test_a_store_is_empty_before_it_begins_and_after_it_is_removed(store, tmp_path):
    assert store.settings() is None
    store.resume({"seed": 1})
    store.write("a", ARRAYS)
    assert store.names() == ["a"]
    store.remove()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "harm",
    [
        lambda path: path.write_bytes(b""),
        *(lambda path, left=left: path.write_bytes(path.read_bytes()[:left]) for left in (500, -9)),
        lambda path: path.unlink(),
        lambda path: np.savez(path, something=np.zeros(3)),
        lambda path: np.savez(path, x=np.array([{}], object)),
    ],
    ids=["emptied", "half", "cut", "gone", "other", "code"],
)
def test_a_damaged_piece_is_one_sentence_with_the_remedy(store, harm):
    store.begin({})
    harm(store.write("a", ARRAYS))
    message = message_of(read, store, error=Damaged)
    assert "a.npz" in message
    assert message.endswith("begin anew.")


def test_no_alteration_of_a_piece_goes_unnoticed(store):
    """Every byte that matters is under a checksum; the rest changes nothing."""
    store.begin({})
    path = store.write("a", ARRAYS)
    data, rng, noticed = path.read_bytes(), np.random.default_rng(0), 0
    for place in rng.integers(0, len(data), 200):
        altered = bytes([data[place] ^ (1 << rng.integers(8))])
        path.write_bytes(data[:place] + altered + data[place + 1 :])
        try:
            found = read(store)
        except Damaged:
            noticed += 1
            continue
        for name, value in ARRAYS.items():
            np.testing.assert_array_equal(found[name], value)
    assert noticed > 150


@pytest.mark.parametrize("text", ["{", "", "[" * 100_000, "1" * 5000])
def test_what_cannot_be_read_is_not_taken_for_settings(store, text):
    store.begin({})
    (store.folder / SETTINGS).write_text(text)
    assert SETTINGS in message_of(store.settings)


def test_a_job_of_other_settings_is_refused_by_name_with_both_values(store):
    old, new = {"seed": 0, "grid": {"n": (1, 2)}}, {"seed": 0, "grid": {"n": (1,)}, "more": None}
    assert list(differences(old, new)) == ["grid: n = 1,2, now 1"]
    store.check_same(old, old)
    with pytest.raises(InputError, match="grid: n = 1,2, now 1"):
        store.check_same(old, new)


def test_only_pieces_that_are_missing_or_damaged_are_made(store):
    store.begin({})
    store.write("1", {"x": np.array(-1)})
    store.write("2", {"x": np.array(-2)}).write_bytes(b"PK")
    found = dict(store.made(((str(n), n) for n in range(4)), lambda n: {"x": np.array(n)}))
    assert {name: int(arrays["x"]) for name, arrays in found.items()} == {
        "0": 0, "1": -1, "2": 2, "3": 3
    }  # fmt: skip
    assert int(store.read("3", "x")["x"]) == 3
