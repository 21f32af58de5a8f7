"""Boxes joined by IoU: the best assignment, and tracks that continue, end and begin."""

import numpy as np

from jaxpf.measures.association import advance, assigned, no_tracks

NONE = np.zeros((0, 4))


def at(*lefts):
    return np.array([[left, 0.0, 10, 10] for left in lefts]).reshape(-1, 4)


def test_the_best_assignment_is_not_the_greedy_one():
    # Greedily 10 takes 12.5 (IoU .6) and leaves nothing to 16; together they do better.
    assert assigned(at(10.0, 16.0), at(12.5, 7.0), 0.2).tolist() == [1, 0]
    assert assigned(at(0.0), at(9.0), 0.3).tolist() == [-1]
    assert assigned(at(), at(9.0), 0.3).tolist() == []


def test_tracks_by_hand():
    """Two objects pass through six frames; the first is missed in frame 2, the second from 3."""
    tracks = no_tracks()
    frames = [at(0, 50), at(2, 52), at(54), at(6), at(8), at(10, 90)]
    seen = []
    for detections in frames:
        tracks = advance(tracks, detections, most_missed=2)
        seen.append((tracks.ids.tolist(), tracks.boxes[:, 0].tolist(), tracks.hits.tolist()))
    assert seen == [
        ([1, 2], [0, 50], [1, 1]),
        ([1, 2], [2, 52], [2, 2]),
        ([1, 2], [2, 54], [2, 3]),
        ([1, 2], [6, 54], [3, 3]),
        ([1, 2], [8, 54], [4, 3]),
        ([1, 3], [10, 90], [5, 1]),
    ]


def test_an_id_is_never_used_again():
    tracks = no_tracks()
    ids = []
    for detections in (at(0), NONE, at(0), NONE, at(0)):
        tracks = advance(tracks, detections, most_missed=0)
        ids += tracks.ids.tolist()
    assert ids == [1, 2, 3]
