"""Objects that a start file names in later frames: they start there, or are corrected.

Objects that start in the same frame form a group with a tracker of its own, learned in that frame.
An object that starts again leaves its former group, whose other objects go on as before.
"""

import dataclasses
import itertools
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf.cli.tracking.records import Record, Scene, fixed_population
from jaxpf.contract.errors import InputError
from jaxpf.contract.types import TrackerLike
from jaxpf.media.overlay import object_colours
from jaxpf.targets.target import Start


def all_names(start: Start, later: Mapping[int, Start]) -> np.ndarray:
    """Names of all objects, in the order of their first frames."""
    names = [name for each in (start, *later.values()) for name in each.ids.tolist()]
    return np.array(list(dict.fromkeys(names)))


#: Fields of a record with a row for each object.
_ROWS = ("shapes", "lost", "confidence", "outside", "without_likelihood")


class _Group(NamedTuple):
    """Objects that start in one frame: their scene, their names, and their records to come."""

    scene: Scene
    ids: np.ndarray
    records: Iterator[Record]


def starting_later(
    scene: Scene,
    tracker: TrackerLike,
    key: jax.Array,
    frame: np.ndarray,
    frames: Iterable[np.ndarray],
    later: Mapping[int, Start],
    make: Callable[[np.ndarray, Start], TrackerLike],
) -> Iterator[Record]:
    """Records of objects that start, or start again, in later frames.

    Args:
        scene, tracker, key, frame, frames: see ``fixed_population``.
        later: frame -> the objects that start there.
        make: function from a frame and a start to a tracker.
    """
    names = all_names(scene.start, later)
    colours = dict(zip(names.tolist(), object_colours(len(names)), strict=True))
    groups: list[_Group] = []
    source = iter(frames)
    for number in itertools.count(scene.first):
        start = scene.start if number == scene.first else later.get(number)
        if start is not None:
            source, own = itertools.tee(source)
            if groups:
                tracker = make(frame, start)
            of_start = dataclasses.replace(scene, tracker=tracker, start=start, first=number)
            own_key = jax.random.fold_in(key, number) if groups else key
            records = fixed_population(of_start, tracker, own_key, frame, own, (None, 0))
            groups = [group._replace(ids=np.setdiff1d(group.ids, start.ids)) for group in groups]
            groups = [group for group in groups if len(group.ids)]
            groups.append(_Group(of_start, start.ids, records))
        yield _joined([_part(group, colours) for group in groups])
        try:
            frame = next(source)
        except StopIteration:
            break
    missed = [at for at in later if at > number]
    if missed:
        raise InputError(
            f"the start file has a row for frame {missed[0]}, but the last frame is {number}; "
            "remove or correct that row."
        )


def _part(group: _Group, colours: Mapping[Hashable, np.ndarray]) -> Record:
    """The next record of a group, of the objects that it still tracks."""
    record = next(group.records)
    kept = np.flatnonzero(np.isin(record.start.ids, group.ids))
    places = {name: values[kept] for name, values in record.places.items()}
    ids = record.start.ids[kept]
    start = dataclasses.replace(
        record.start,
        ids=ids,
        shapes=record.start.shapes[kept],
        sizes=record.start.sizes[kept],
        parents=(-1,) * len(kept),
    )
    rows: dict[str, Any] = {
        name: None if getattr(record, name) is None else getattr(record, name)[kept]
        for name in _ROWS
    }
    colour = np.array([colours[name] for name in ids.tolist()])
    return record._replace(
        start=start, places=places, slots=kept, colours=colour, scene=group.scene, **rows
    )


def _joined(parts: list[Record]) -> Record:
    """One record of several groups' objects, which ``parts`` also keep apart."""

    def rows(values: Iterable[np.ndarray]) -> np.ndarray:
        return np.concatenate(list(values))

    start = dataclasses.replace(
        parts[0].start,
        ids=rows(part.start.ids for part in parts),
        shapes=rows(part.start.shapes for part in parts),
        sizes=rows(part.start.sizes for part in parts),
        parents=(-1,) * sum(len(part.start.ids) for part in parts),
    )
    return parts[0]._replace(
        start=start,
        colours=rows(part.colours for part in parts),
        shapes=rows(part.shapes for part in parts),
        lost=rows(part.lost for part in parts),
        parts=tuple(parts),
    )
