"""Objects that a start file names in later frames: they start there, or are put right.

Objects that start in the same frame form a group with a tracker of its own, learned in that frame.
An object that starts again leaves its former group, whose other objects go on as before.
"""

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf.cli.tracking.records import Record, Scene, fixed_population
from jaxpf.cli.tracking.track_table import Places
from jaxpf.contract.errors import InputError
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
    tracker: Any,
    key: Any,
    frame: np.ndarray,
    frames: Any,
    later: Mapping[int, Start],
    make: Callable[[np.ndarray, Start], Any],
) -> Iterator[Record]:
    """Records of objects that start, or start again, in later frames.

    Args:
        scene, tracker, key, frame, frames: see ``fixed_population``.
        later: frame -> the objects that start there.
        make: function from a frame and a start to a tracker.
    """
    from jaxpf.media.overlay import object_colours

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
        yield _joined([_part(group, colours) for group in groups], names)
        try:
            frame = next(source)
        except StopIteration:
            break
    missed = [at for at in later if at > number]
    if missed:
        raise InputError(
            f"the start file names frame {missed[0]}, and the last frame is {number}; correct it."
        )


def _part(group: _Group, colours: Mapping[Any, np.ndarray]) -> Record:
    """The next record of a group, of the objects that it still tracks."""
    record = next(group.records)
    kept = np.flatnonzero(np.isin(record.start.ids, group.ids))
    places = Places._make(
        None if value is None else value[:, kept] if field.endswith("interval") else value[kept]
        for field, value in zip(Places._fields, record.places, strict=True)
    )
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


def _joined(parts: list[Record], names: np.ndarray) -> Record:
    """One record of several groups' objects, which ``parts`` also keep apart."""
    tracked = [part for part in parts if part.summary is not None]

    def together(values: list[Any], axis: int = 0) -> Any:
        """Rows of all groups; NaN for a group without, None if there is none at all."""
        if all(value is None for value in values):
            return None
        like = next(value for value in values if value is not None)
        filled = []
        for value, part in zip(values, parts, strict=True):
            shape = list(like.shape)
            shape[axis] = len(part.slots)
            fill = False if like.dtype == bool else np.nan
            filled.append(np.full(shape, fill, like.dtype) if value is None else value)
        return np.concatenate(filled, axis=axis)

    places = Places._make(
        together([getattr(part.places, field) for part in parts], int(field.endswith("interval")))
        for field in Places._fields
    )
    start = dataclasses.replace(
        parts[0].start,
        ids=np.concatenate([part.start.ids for part in parts]),
        shapes=np.concatenate([part.start.shapes for part in parts]),
        sizes=np.concatenate([part.start.sizes for part in parts]),
        parents=(-1,) * sum(len(part.slots) for part in parts),
    )
    rows: dict[str, Any] = {
        name: together([getattr(part, name) for part in parts]) for name in _ROWS
    }
    return parts[0]._replace(
        start=start,
        places=places,
        colours=np.concatenate([part.colours for part in parts]),
        slots=np.array([names.tolist().index(name) for name in start.ids.tolist()]),
        summary=_summary(tracked, names) if tracked else None,
        state=None,
        parts=tuple(parts),
        **rows,
    )


def _summary(parts: list[Record], names: np.ndarray) -> Any:
    """What diagnostics report of several groups, by object in the order of ``names``."""
    rows: dict[str, np.ndarray] = {}
    for part in parts:
        at = [names.tolist().index(name) for name in part.start.ids.tolist()]
        for name in ("uniqueness", "confidence"):
            values = getattr(part.summary, name, None)
            if values is not None:
                row = rows.setdefault(name, np.full(len(names), np.nan))
                row[at] = np.asarray(values)[part.slots]
    summaries = [part.summary for part in parts]
    return SimpleNamespace(
        ess=min(float(getattr(summary, "ess", np.nan)) for summary in summaries),
        log_evidence=sum(float(getattr(summary, "log_evidence", np.nan)) for summary in summaries),
        num_invalid=sum(int(getattr(summary, "num_invalid", 0)) for summary in summaries),
        **rows,
    )
