"""A paper that is repeated: one frame for all of them.

Each paper has a folder with the same files: ``published`` (its figures, as data), ``scenes`` (what
is drawn or read, and the runs on it), ``tables``, ``claims`` and ``figures``, each of which makes
what its name says from what was measured, and ``__init__`` with the ``PAPER``.  What it measures it
keeps piece by piece (``jaxpf.papers.measuring.checkpoints``), so that it
goes on after a stop.  The names of
the pieces tell the number of runs where that matters: looks at more and more runs share them.
"""

import contextlib
import dataclasses
import importlib
import itertools
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.papers.judging.claims import CANNOT_RESOLVE, Claim, at_look, grows, level_of, told
from jaxpf.papers.judging.comparison_table import Comparison, Table
from jaxpf.papers.measuring.checkpoints import part

#: Papers that can be repeated; each is a module here, with a ``PAPER``.
PAPERS = ("smith2004", "gonzales2011", "rowe2005", "eskil2014", "maccormick1999")


def paper_of(name: str) -> "Paper":
    """The paper of that name."""
    return importlib.import_module(f"jaxpf.papers.{name}").PAPER


@dataclasses.dataclass(frozen=True)
class Request:
    """What of a paper is to be repeated.

    Attributes:
        runs: independent ones per cell.
        seeds: of the scenes, which share the runs.
        seed: the first of them.
        quick: measure much less, to see what it does.
        data: folder with real clips, or None.
        clips: what the paper reads of it; None without ``data``.
        report: takes a line of progress.
    """

    runs: int
    seeds: range
    seed: int
    quick: bool
    data: Path | None
    clips: Any
    report: Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Paper:
    """How a paper is repeated.

    Attributes:
        name: such as "smith2004".
        title: one line.
        runs: per cell, and of the quick version.
        runs_per_scene: scenes are the units of the intervals.
        measure: gives everything that tables, claims and figures are made of.
        tables: of what was measured, in the order in which they are shown.
        claims: with their verdicts.
        figures: stem of the file -> matplotlib figure.
        notes: sentences on what was done and what to beware of.
        read: the clips of a folder, ``read(data, quick)``, before the work begins; raises
            ``InputError`` where they are missing.
        with_clips: a note where there are clips.
        without_clips: a note where there are none.
        settings: what repeats the run beside the request; JSON values.
        calibrate: repeats the search for unpublished settings, ``calibrate(report, data) ->
            Table``, with a folder of real clips or None.
    """

    name: str
    title: str
    runs: int
    quick_runs: int
    runs_per_scene: int
    measure: Callable[[Request], Any]
    tables: Callable[[Any], Sequence[Table]]
    claims: Callable[[Any], Sequence[Claim]]
    figures: Callable[[Any], Mapping[str, Any]]
    notes: Sequence[str]
    read: Callable[[Path, bool], Any]
    without_clips: str
    with_clips: str = ""
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    calibrate: Callable[[Callable[[str], None], Path | None], Table] | None = None

    def request(
        self,
        runs: int | None = None,
        seed: int = 0,
        quick: bool = False,
        data: Path | None = None,
        report: Callable[[str], None] = print,
    ) -> Request:
        """Check what is asked, and read the clips, before the work begins.

        Args:
            runs: per cell; None: the paper's number, or ``quick_runs``.
            seed: of the first scene and its runs.
            quick: a much smaller version, which shows what the full one would.
            data: a folder with real clips.
            report: takes a line of progress.

        Raises:
            InputError: the runs cannot be shared out evenly among scenes, or a clip is missing.
        """
        if runs is None:
            runs = self.quick_runs if quick else self.runs
        if runs % self.runs_per_scene:
            raise InputError(
                f"--runs {runs} must be a multiple of {self.runs_per_scene}: each scene takes "
                f"{self.runs_per_scene} runs."
            )
        clips = None if data is None else self.read(data, quick)
        seeds = range(seed, seed + runs // self.runs_per_scene)
        return Request(runs, seeds, seed, quick, data, clips, report)

    def compare(self, request: Request, look: int | None = None) -> Comparison:
        """Measure what is asked, and put it beside what is published.

        Args:
            request: what is asked.
            look: the how manieth look at data that grow, from 1; None: the only one.
        """
        found = self.measure(request)
        claims, notes = self.claims(found), [*self.notes]
        if look is not None:
            claims = [at_look(claim, look) for claim in claims]
            notes.append(
                f"Look {look}, at {request.runs} runs: intervals of claims are those of the level "
                f"{100 * level_of(look):.3g} %, so that verdicts hold at whichever look they fall."
            )
        about_clips = self.without_clips if request.data is None else self.with_clips
        return Comparison(
            paper=self.name,
            title=self.title,
            tables=self.tables(found),
            claims=[told(claim, request.runs) for claim in claims],
            figures=self.figures(found),
            notes=[*notes, *filter(None, [about_clips])],
            settings={
                "runs": request.runs,
                "seed": request.seed,
                "quick": request.quick,
                "data": request.data is not None,
                **self.settings,
            },
        )

    def run(self, **asked: Any) -> Comparison:
        """``compare`` what ``request`` is asked for, in one call."""
        return self.compare(self.request(**asked))


def until_resolved(paper: Paper, request: Request, minutes: float) -> Iterator[Comparison]:
    """Look at a paper's claims with twice the runs each time, until every one is resolved.

    Where parts are kept, a look measures only what those before it have not.  None is begun that
    would end after ``minutes``, if it takes as long as all before it took when they were measured,
    which may have been in another call.  (What a call that was stopped measured is not counted.)

    Args:
        paper: which.
        request: of the first look.
        minutes: from now.

    Yields:
        What each look found.
    """
    began, runs, spent = time.monotonic(), request.runs, 0.0
    for look in itertools.count(1):
        looked = time.monotonic()
        seeds = range(request.seed, request.seed + runs // paper.runs_per_scene)
        comparison = paper.compare(dataclasses.replace(request, runs=runs, seeds=seeds), look)
        now = time.monotonic()
        spent += float(part(f"look-{runs}", partial(_seconds, now - looked))["seconds"])
        pending = [claim for claim in comparison.claims if claim.verdict == CANNOT_RESOLVE]
        request.report(
            f"Look {look}: {runs} runs, {len(pending)} of {len(comparison.claims)} claims open"
        )
        yield comparison
        hopeless = all(math.isinf(claim.growth) or not grows(claim) for claim in pending)
        if hopeless or now - began + spent > 60 * minutes:
            return
        runs *= 2


def _seconds(took: float) -> dict[str, Any]:
    return {"seconds": np.float64(took)}


def clip_folder(data: Path, name: str, needed: str = ".") -> Path:
    """The folder of a clip: ``data`` itself, or the one in it.

    Raises:
        InputError: it is not there, or holds no file ``needed``.
    """
    folder = data if data.name == name else data / name
    if not (folder.is_dir() and (folder / needed).exists()):
        what = name if needed == "." else f"{name} with {needed}"
        raise InputError(
            f"the folder '{data}' holds no {what}; name one that does, or leave out --data."
        )
    return folder


@contextlib.contextmanager
def reading_clips() -> Iterator[None]:
    """Turn what is wrong with a clip within the block into an ``InputError``."""
    from scenes import SceneError

    try:
        yield
    except SceneError as error:
        raise InputError(f"{error}.") from error
