"""What is written is read again, whatever the names and numbers of any machine.

Files of MOT, of detections and of contours have such a test in their own rooms.
"""

import contextlib
import csv
import math
import tomllib
from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from jaxpf import InputError, save
from jaxpf.boxes import read_boxes, read_tracks
from jaxpf.cli.marking.starts import write_start
from jaxpf.cli.shared.flags import write_config
from jaxpf.cli.tracking.columns import TrackTable
from jaxpf.files.reading import check_name, read_rows
from jaxpf.files.states import load_like
from jaxpf.files.store import Store, differences
from jaxpf.files.writing import csv_text
from jaxpf.points.files import read_points

#: The same cases every time, and at most two seconds of a processor.
EVERY = settings(max_examples=40, deadline=None, derandomize=True, database=None)

#: Names as people, spreadsheets and other systems write them, beside any letters.
ODD = (
    *("=1+1", "@x", "+a", "-b", "'=1", "''-c", "'quoted", "-1.5", "-inf", "-1 to x", "a,b", "a;b"),
    *('say "x"', '"', "'", "C:\\Users\\Ü", "\\\\server\\share", "~/a b", "a/b", "nan", "1e3", "01"),
    *("größe", "grö\u00dfe", "e\u0301", "名前", "\u200bx", "\ufeffx", "🙂"),
    *("[/red]", "%s", "true", "#1"),
)
texts = st.sampled_from(ODD) | st.text(max_size=30)


def fits(name):
    """Whether a name fits in a field of a table, which readers strip."""
    with contextlib.suppress(InputError):
        check_name(name, "here")
        return name == name.strip()
    return False


names = texts.filter(fits)
finite = st.floats(allow_nan=False, allow_infinity=False)
#: Pixels: zeros of both signs, the smallest and the largest.
pixels = st.floats(-1e9, 1e9 - 1) | st.sampled_from([-0.0, 5e-324, -1e-7, -1e9, 123456789.125])
extents = st.floats(0.01, 1e9)
boxes = st.tuples(pixels, pixels, extents, extents)
whole = st.integers(0, 2**53 - 1)
keys = st.tuples(whole, st.integers(-(2**53) + 1, 2**53 - 1))


def rows_of(values):
    return st.lists(values, min_size=1, max_size=9, unique_by=lambda row: row[:2])


def in_pixels(boxes):
    """Whether boxes are not refused as shares of the frame's size."""
    return np.abs(boxes).max() > 3


def same_bits(one, other):
    """Equal, with the signs of zeros, and with what is not a number."""
    one, other = np.asarray(one), np.asarray(other)
    assert (one.dtype, one.shape) == (other.dtype, other.shape)
    assert one.tobytes() == other.tobytes()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("round trips")


@EVERY
@given(rows=st.lists(st.lists(names | st.just(""), min_size=2, max_size=2).filter(any)))
def test_texts_of_a_table(folder, rows):
    (folder / "texts.csv").write_text(csv_text([["a", "b"], *rows]), encoding="utf-8")
    read = [fields for _, fields in read_rows(folder / "texts.csv", "texts", "texts")]
    assert [[*fields, ""][:2] for fields in read] == [["a", "b"], *rows]


@EVERY
@given(rows=rows_of(st.tuples(whole, keys.map(lambda key: key[1]), boxes, st.integers(-1, 2))))
def test_gt_csv(folder, rows):
    if not in_pixels([row[2] for row in rows]):
        return
    with open(folder / "gt.csv", "w", newline="") as file:
        csv.writer(file).writerow(("frame", "id", "x", "y", "w", "h", "occ"))
        csv.writer(file).writerows((f, i, *map(repr, box), occ) for f, i, box, occ in rows)
    table = read_boxes(folder / "gt.csv", truth=True)
    assert [*zip(table.frame, table.id, table.occlusion, strict=True)] == [
        (frame, identity, occ) for frame, identity, _, occ in rows
    ]
    same_bits(table.box, [box for _, _, box, _ in rows])


#: Columns of tracks.csv beside the place: values, of which some are missing.
MEASURED = ("x_2.5", "speed")
missing = st.just(math.nan)


@st.composite
def tracked(draw):
    """Ids, and for some frames their places, what was measured, confidence and who is lost."""
    ids = draw(
        st.lists(st.integers(-(10**17), 10**17) | names, min_size=1, max_size=3, unique_by=str)
    )
    row = st.tuples(
        *[pixels] * 2, *[pixels | missing] * 2, st.floats(0, 1) | missing, st.booleans()
    )
    frames = draw(
        st.lists(st.lists(row, min_size=len(ids), max_size=len(ids)), min_size=1, max_size=3)
    )
    return ids, frames


@EVERY
@given(tracked=tracked(), rate=st.sampled_from([0.3, 25, 29.97, 1e6]))
def test_tracks_csv(folder, tracked, rate):
    ids, frames = tracked
    every = ("x", "y", *MEASURED, "confidence", "lost", "x_mc_error")
    with TrackTable(folder / "tracks.csv", ("x", "y"), every) as table:
        for number, rows in enumerate(frames):
            columns = np.array(rows, float).T
            places = dict(zip(every, [*columns, columns[0]], strict=True))
            table.add(number, number / rate, (ids, places))
    read = read_tracks(folder / "tracks.csv")
    assert [str(name) for name in read.pop("id")] == [*map(str, ids)] * len(frames)
    found = np.array([read[name] for name in ("x", "y", *MEASURED, "confidence", "lost")])
    expected = np.concatenate(frames).astype(float).T
    np.testing.assert_allclose(found[:4], expected[:4], atol=0.00051, rtol=1e-12)
    np.testing.assert_allclose(found[4:], expected[4:], rtol=1e-5)


def test_a_name_of_digits_of_two_scripts(folder):
    (folder / "tracks.csv").write_text("frame,time,id\n0,0,1\u0663\n", encoding="utf-8")
    assert read_tracks(folder / "tracks.csv")["id"].tolist() == ["1\u0663"]


@EVERY
@given(shapes=st.lists(st.tuples(st.integers(0, 10**6), names, pixels, pixels), min_size=1,
                       max_size=5, unique_by=lambda row: row[1]))  # fmt: skip
def test_start_points(folder, shapes):
    keys = "frame", "name", "x", "y"
    write_start(folder / "p.csv", "points", [dict(zip(keys, row, strict=True)) for row in shapes])
    read, shapes = read_points(folder / "p.csv"), sorted(shapes, key=lambda row: row[0])
    assert [*zip(read.frames, read.names, strict=True)] == [row[:2] for row in shapes]
    np.testing.assert_allclose(read.places, [row[2:] for row in shapes], rtol=1e-9, atol=1e-300)


plain = st.booleans() | st.integers(-(2**63), 2**63 - 1) | finite | texts
options = st.dictionaries(
    st.text("abcdefghij_0", min_size=1), plain | st.lists(texts) | st.lists(finite)
)


@EVERY
@given(options=options, file=names)
def test_run_toml(folder, options, file):
    """Numbers, and names of files on any system."""
    written = {**options, "file": Path(file), "left-out": None}
    write_config(folder / "run.toml", "track", written)
    read = tomllib.loads((folder / "run.toml").read_bytes().decode())
    assert repr(read) == repr(
        {"track": {**options, "file": str(Path(file))}}
    )  # with signs of zeros


#: Arrays of every type that states and pieces have; any bits: subnormals, infinities, NaN.
arrays = st.sampled_from(["f4", "i4", "u4", "u1", "?"]).flatmap(
    lambda kind: hnp.arrays(kind, hnp.array_shapes(min_dims=0, min_side=0, max_side=3))
)
trees = st.recursive(
    arrays | st.integers(0, 2**32 - 1).map(jax.random.key),
    lambda inner: st.dictionaries(names, inner, min_size=1, max_size=2) | st.tuples(inner, inner),
    max_leaves=4,
)


@EVERY
@given(state=trees)
def test_states(folder, state):
    save(folder / "state.npz", state)
    wanted = jax.eval_shape(lambda: jax.tree.map(jax.numpy.asarray, state))
    read = load_like(folder / "state.npz", wanted, "Own")
    assert jax.tree.structure(read) == jax.tree.structure(state)
    for one, other in zip(jax.tree.leaves(read), jax.tree.leaves(state), strict=True):
        if jax.dtypes.issubdtype(other.dtype, jax.dtypes.prng_key):
            assert jax.random.key_impl(one) == jax.random.key_impl(other)
            one, other = jax.random.key_data(one), jax.random.key_data(other)
        same_bits(one, other)


json_values = st.recursive(
    st.none() | plain,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=6,
)


@EVERY
@given(
    settings=st.dictionaries(texts, json_values, max_size=4),
    name=names.filter(lambda name: "/" not in name and len(name.encode()) < 200),
    content=st.dictionaries(
        names.filter(lambda name: not name.endswith(".npy")), arrays | st.text().map(np.array)
    ),
)
def test_the_store(folder, settings, name, content):
    store = Store(folder / "store")
    store.begin(settings)
    assert repr(store.settings()) == repr(settings)
    assert list(differences(store.settings(), settings)) == []
    store.write(name, content)
    with store.opened(name) as piece:
        assert sorted(piece) == sorted(content)
        for field, values in content.items():
            same_bits(piece[field], values)
