"""What properties are proved over: the same cases every time, and no more than a glance takes."""

from hypothesis import settings, strategies as st

EVERY = settings(max_examples=60, deadline=None, derandomize=True, database=None)

coordinates = st.floats(-1e6, 1e6)
#: Of boxes; numbers from 0 to 1 alone are refused, as shares of the frame.
extents = st.floats(2, 1e6)
boxes = st.tuples(coordinates, coordinates, extents, extents)
#: Names of points, parts and contours.
names = st.text("aZ9é日ß_-+=,\"'$<", min_size=1, max_size=5)


def tracks(ids):
    """Rows (frame, id, box, confidence) of a table of tracks, each object once in a frame."""
    row = st.tuples(st.integers(0, 10**6), ids, boxes, st.integers(0, 10**6))
    return st.lists(row, min_size=1, max_size=9, unique_by=lambda row: row[:2])
