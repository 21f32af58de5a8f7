"""tracks.csv, whatever objects are called and wherever they are: what is written is read."""

import contextlib
from types import SimpleNamespace

import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from properties import EVERY, coordinates, names

from jaxpf.boxes import read_tracks
from jaxpf.cli.tracking.records import Record
from jaxpf.cli.tracking.track_table import Tracks
from jaxpf.points.target import POINTS
from jaxpf.targets import Start

#: Frames; two points in each, with x, y, their interval and speed; NaN where there is none.
numbers = arrays(float, st.tuples(st.integers(2, 4), st.just(2), st.just(5)), elements=coordinates)
ids = st.lists(names | st.integers(0, 999).map(str), min_size=2, max_size=2, unique=True)


@EVERY
@given(ids=ids, numbers=numbers, absent=st.integers(0, 3))
def test_tracks_are_read_as_they_were_written(tmp_path_factory, ids, numbers, absent):
    folder = tmp_path_factory.getbasetemp()
    numbers[absent % len(numbers), 1] = np.nan
    numbers[0, 0, 2:] = np.nan
    start = Start(np.array(ids), numbers[0, :, :2], np.ones((2, 2)), (-1, -1))
    scene = SimpleNamespace(target=POINTS, start=start, shown_at=lambda number: number / 25)
    columns = ("x", "y", "x_2.5", "x_97.5", "speed")
    with contextlib.ExitStack() as stack:
        tracks = Tracks(folder, scene, stack)
        for number, values in enumerate(numbers):
            places = dict(zip(columns, values.T, strict=True))
            lost = np.array([False, number > 1])
            tracks(Record(number, None, start, None, values[:, :2], places, lost, values[:, 4]))
    read, kept = read_tracks(folder / "tracks.csv"), tracks.table
    assert list(read["id"].astype(str)) == list(kept.pop("id").astype(str))
    assert set(read) == {"id", *kept}
    for name, values in kept.items():
        np.testing.assert_array_equal(read[name], values, err_msg=name)
    there = np.isfinite(numbers[..., 0])
    np.testing.assert_array_equal(read["frame"], np.nonzero(there)[0])
    np.testing.assert_allclose(read["x"], numbers[there][:, 0], atol=0.00051)
