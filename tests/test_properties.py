"""What holds for every box, part tree, order and option, not only for those that we thought of."""

import csv
import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from properties import EVERY, boxes, coordinates, extents

from jaxpf import InputError, ordering
from jaxpf.boxes.tracks import parse_box
from jaxpf.contract import Option
from jaxpf.parts.files import HEADER, read_parts


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("properties") / "file"


@EVERY
@given(box=boxes)
def test_a_typed_box_is_read_as_it_was_meant(box):
    assert parse_box(",".join(map(repr, box))).tolist() == list(box)


@EVERY
@given(text=st.text(max_size=40))
def test_any_text_is_a_box_or_refused(text):
    try:
        box = parse_box(text)
    except InputError as refusal:
        assert str(refusal)  # noqa: PT017
    else:
        assert np.isfinite(box).all()
        assert (box[2:] > 0).all()


@st.composite
def trees(draw):
    """Parents in any order, -1 for the only root, of some permutation of parts."""
    count = draw(st.integers(1, 8))
    parents = [-1] + [draw(st.integers(0, part - 1)) for part in range(1, count)]
    place = draw(st.permutations(range(count)))
    found = [0] * count
    for part, parent in enumerate(parents):
        found[place[part]] = -1 if parent < 0 else place[parent]
    return found


@EVERY
@given(parents=trees(), data=st.data())
def test_any_tree_of_parts_is_read_as_it_was_written(file, parents, data):
    word = st.text(st.characters(codec="utf-8", categories=["L", "N"]), min_size=1, max_size=9)
    names = data.draw(st.lists(word, min_size=len(parents), max_size=len(parents), unique=True))
    numbers = [data.draw(st.tuples(coordinates, coordinates, extents, extents, coordinates))
               for _ in parents]  # fmt: skip
    with open(file, "w", encoding="utf-8", newline="") as out:
        lines = csv.writer(out)
        lines.writerow(HEADER.split(","))
        for name, parent, values in zip(names, parents, numbers, strict=True):
            lines.writerow([name, names[parent] if parent >= 0 else "", *map(repr, values)])
    parts = read_parts(file)
    assert parts.names == tuple(names)
    assert parts.parents == tuple(parents)
    np.testing.assert_array_equal(parts.sizes, np.array(numbers)[:, 2:4])
    degrees = np.array(numbers)[:, 4]
    np.testing.assert_allclose(np.rad2deg(parts.poses[:, 2]), degrees, rtol=1e-12, atol=1e-300)


@EVERY
@given(order=st.integers(1, 9).flatmap(lambda count: st.permutations(range(count))))
def test_every_permutation_is_an_order_whose_rank_undoes_it(order):
    made = ordering.ps(order)
    assert np.asarray(made.order)[0].tolist() == list(order)
    assert [int(np.asarray(made.rank)[0][part]) for part in order] == list(range(len(order)))
    assert float(np.sum(np.asarray(made.fractions))) == 1.0


@EVERY
@given(order=st.lists(st.integers(-2, 5), max_size=6))
def test_what_is_no_permutation_is_no_order(order):
    if sorted(order) == list(range(len(order))) and order:
        return
    with pytest.raises(InputError, match="not a permutation"):
        ordering.ps(order)


@EVERY
@given(parents=trees())
def test_parts_are_treated_after_their_parents_whatever_the_tree(parents):
    rank = np.asarray(ordering.sps(parents).rank)[0]
    assert all(rank[part] > rank[parent] for part, parent in enumerate(parents) if parent >= 0)


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=5,
)


@EVERY
@given(value=anything, kind=st.sampled_from([int, float, str, bool]), length=st.integers(-1, 3))
def test_an_option_has_its_type_and_bounds_or_is_refused(value, kind, length):
    if kind in (str, bool):
        length = 0
    one = Option("Help.", name="x", kind=kind, length=length, least=-5, most=100, default=kind())
    try:
        found = one.checked(value)
    except InputError as refusal:
        assert "x = " in str(refusal)  # noqa: PT017
        return
    assert one.checked(found) == found, "checking again changes nothing"
    values = found if length else (found,)
    assert all(type(entry) is kind for entry in values)
    if kind in (int, float):
        assert all(-5 <= entry <= 100 and math.isfinite(entry) for entry in values)
    assert length <= 0 or len(values) == length
