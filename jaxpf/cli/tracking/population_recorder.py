"""What `jaxpf track --births` leaves behind, where objects come and go."""

import dataclasses
import itertools
from typing import Any

import click
import numpy as np

from jaxpf.cli.shared import console
from jaxpf.cli.tracking.births import by_frame
from jaxpf.cli.tracking.recorder import Recorder, counted
from jaxpf.populations.lifetimes import EMPTY
from jaxpf.targets.adapter import Marks

_SCORES = ("HOTA", "DetA", "AssA", "IDF1", "MOTA", "MOTP")
_COUNTS = ("FP", "FN", "IDSW", "Frag")


class PopulationRecorder(Recorder):
    """A recorder of slots, which hold now one object and now another, or none."""

    def __init__(self, output, source, request, start, tracker):
        capacity = request.births.rules.capacity
        slots = np.array([f"slot_{number}" for number in range(1, capacity + 1)])
        super().__init__(output, source, request, dataclasses.replace(start, ids=slots), tracker)
        self.births, self.start_boxes = request.births, start
        self.frames_outside.clear()
        self.frames_without_likelihood.clear()
        self.frames_probably_lost.clear()
        self.born: list[dict] = []
        self.ended: list[dict] = []
        self.refused: list[dict] = []

    def start(self, number, frame):
        """The start frame is one of those that ``follow`` goes through."""
        self._first = frame

    def _stream(self, key, frames):
        from jaxpf.populations import follow

        number = self.request.run.start
        detections, named = by_frame(self.births, self.start_boxes, number)
        frames = itertools.chain([self._first], frames)
        rules = self.births.rules
        for tracked in follow(self.tracker, key, frames, detections, named=named, rules=rules):
            self._note(number + tracked.time, tracked.changes)
            if tracked.time == 0:
                self._write(number, tracked)
            else:
                yield tracked._replace(time=tracked.time - 1)

    def _note(self, number, changes):
        for birth in changes.births:
            self.born.append({"id": birth.id, "frame": number, "box": birth.box.tolist()})
        for death in changes.deaths:
            self.ended.append({"id": death.id, "frame": number, "reason": death.reason})
        for refusal in changes.refused:
            name = None if refusal.id == EMPTY else refusal.id
            box, reason = refusal.box.tolist(), refusal.reason
            self.refused.append({"id": name, "frame": number, "box": box, "reason": reason})

    def _record(self, number, tracked):
        summary = tracked.summary
        for name in tracked.ids[tracked.lost]:
            self.frames_without_likelihood.setdefault(str(name), []).append(number)
        self._note_summary(number, summary)
        self._write(number, tracked)
        self.num_tracked += 1

    def _write(self, number, tracked):
        from jaxpf.media.overlay import draw_particles, draw_spreads, object_colours

        living = tracked.ids != EMPTY
        ids, boxes, lost = tracked.ids[living], tracked.boxes[living], tracked.lost[living]
        self.tracks.append(number, boxes, lost, ids)
        if tracked.summary is not None:
            self.uncertainty.append(number, tracked, ids, living)
        if not self._is_watched():
            return
        # An object keeps its colour, whatever slot it has.
        colours = object_colours(int(max(ids, default=0)) + 1)[ids]
        frame = tracked.frame
        if tracked.summary is not None:
            cloud = np.swapaxes(np.asarray(tracked.state.substates)[..., :2], 0, 1)[living]
            frame = draw_particles(frame, cloud, colours)
            centres, spreads = self.uncertainty.places(tracked.summary)[:, living]
            frame = draw_spreads(frame, centres, spreads, colours)
        start = dataclasses.replace(self.start_at, ids=ids)
        self._show(self.adapter.draw(frame, start, boxes, Marks(colours, lost)))

    def _content(self):
        return {
            "ids": [birth["id"] for birth in self.born],
            "births": self.born,
            "deaths": self.ended,
            "refused": self.refused,
        }

    def _tell(self, rate):
        super()._tell(rate)
        came = counted(len(self.born), "object")
        click.echo(f"{came} came, {len(self.ended)} went")
        if self.refused:
            one = self.refused[0]
            click.echo(
                f"Refused: {len(self.refused)} that could not start, first in frame "
                f"{one['frame']}: {one['reason']}",
                err=True,
            )

    def _report_truth(self, truth: Any, which: str = "") -> None:
        """Scores of the frames after the start, which judge identities."""
        from jaxpf.boxes import tracks
        from jaxpf.files.writing import csv_text, write_text
        from jaxpf.measures.scores import tracking_scores

        estimated = tracks.read_boxes(self.output / "tracks.csv", empty_boxes="absent")
        first = self.request.run.start + 1
        last = first + self.num_tracked
        found, true = (
            tracks.dense(table, sorted(set(table.id.tolist())), last)[first:]
            for table in (estimated, truth)
        )
        scores = tracking_scores(found, true)
        console.print_table(
            f"Against the truth, {counted(len(true))}",
            ["", *_SCORES, *_COUNTS],
            [
                [
                    "all",
                    *(f"{scores[name]:.3f}" for name in _SCORES),
                    *(f"{scores[name]:.0f}" for name in _COUNTS),
                ]
            ],
        )
        values = [f"{value:.6g}" for value in scores.values()]
        write_text(self.output / "metrics.csv", csv_text([scores, values]))
