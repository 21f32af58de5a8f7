"""maccormick1999 repeated: MacCormick and Blake, "A probabilistic exclusion principle for tracking
multiple objects", ICCV 1999.

Targets that meet or pass on drawn scenes: figures 1, 4, 6, 7 and 11; and figures 3, 9 and 10.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxpf.media import plotting
from jaxpf.papers.checkpoints import Measurements
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.judging.estimates import computed, mean_of
from jaxpf.papers.maccormick1999 import scenes, toy
from jaxpf.papers.maccormick1999.scenes import (
    FIRST_FRAMES,
    FLIP,
    Case,
    Method,
    Outcome,
    track,
    tracker_of,
)
from jaxpf.papers.paper import Paper
from jaxpf.papers.study import Study, Values
from jaxpf.targets.presets import MACCORMICK1999


def _as_preset(preset: Mapping[str, Any]) -> Method:
    """The method of a preset."""
    kind, ordering, count = map(preset.__getitem__, ("exclusion", "method", "num_particles"))
    return Method(kind, ordering, count, all_printed=True)


EXCLUSIVE, NAIVE = "P, exclusion", "P', none"
LIKELIHOODS = {EXCLUSIVE: "wires", NAIVE: "none"}
#: Suffix for ordinary Condensation, as in the paper's section 3.
CONDENSATION = ", Condensation"
#: Suffix for the likelihood as printed, eq. 2 and 5.
PRINTED = " as printed"
#: Suffix where labels, lines, edges and resampling are as printed, too.
ALL_PRINTED = ", all as printed"
PARTITIONED, AS_MANY, FOUR_TIMES, ENOUGH = "PS, 750", "SIR, 750", "SIR, 3000", "SIR, 4000"
#: 750 partitioned particles as in the paper, and the 4000 that it needs without partitions.
LEAVES = {
    PARTITIONED: Method("opaque", "ps", 750),
    "PS, 750, delta .01": Method("opaque", "ps", 750, 2, FLIP),
    PARTITIONED + PRINTED: Method("opaque-literal", "ps", 750),
    PARTITIONED + ALL_PRINTED: _as_preset(MACCORMICK1999["opaque"]),
    AS_MANY: Method("opaque", "sir", 750),
    FOUR_TIMES: Method("opaque", "sir", 3000),
    ENOUGH: Method("opaque", "sir", 4000, 2),
}
#: The paper does not give N of figure 4.
WIRES = {
    **{name: Method(kind, "ps", 300) for name, kind in LIKELIHOODS.items()},
    **{name + CONDENSATION: Method(kind, "sir", 300) for name, kind in LIKELIHOODS.items()},
    EXCLUSIVE + ALL_PRINTED: _as_preset(MACCORMICK1999["wires"]),
}
FIGURE_11 = {name: LEAVES[name] for name in (PARTITIONED, AS_MANY)}
OCCLUSION, INDEPENDENT = "occlusion", "two trackers"
#: N of figure 6, and ours for each tracker of figure 1.
WALKERS = {
    OCCLUSION: Method("opaque", "sir", 2000),
    OCCLUSION + ALL_PRINTED: Method("opaque-literal", "sir", 2000, 2, all_printed=True),
    INDEPENDENT: Method("none", "independent", 2000, 2),
}


class Passing(NamedTuple):
    """What the figures show of targets that met or passed each other.

    Attributes:
        case: the first sequence.
        outlines: method -> estimates ``[1, T, 2, M, 2]`` on it.
        ess: method -> effective sample sizes ``[S, T]`` on all sequences.
    """

    case: Case
    outlines: Mapping[str, np.ndarray]
    ess: Mapping[str, np.ndarray]


def measure_all(seeds: range, quick: bool, measurements: Measurements) -> Study:
    """Run all measurements; the figures show the toy's steps and a ``Passing`` of every kind."""
    measurements.report("Figure 3 and the toy of figures 9 and 10")
    steps = toy.steps(seeds[0])
    shown: dict[str, Any] = {"toy": steps}
    # Figures 9 and 10: the last step's effective sample size, of each run.
    values: Values = {("toy: ess", name, ""): of_name[-1].ess for name, of_name in steps.items()}
    leaves, walkers = LEAVES, WALKERS
    if quick:
        leaves, walkers = FIGURE_11, {name: WALKERS[name] for name in (OCCLUSION, INDEPENDENT)}
    for kind, title, make, methods in (
        ("wires", "Figure 4, wires", scenes.wires, WIRES),
        ("leaves", "Leaves", scenes.leaves, leaves),
        ("walkers", "Walkers", scenes.walkers, walkers),
        # Before they overlap, with all measurement lines independent as in the paper.
        ("figure_11", "Figure 11", scenes.leaves_of_figure_11, FIGURE_11),
    ):
        measurements.report(f"{title}: {counted(len(seeds), 'sequences')}, one run of each method")
        measured, shown[kind] = measure(kind, make, methods, seeds, measurements)
        values |= measured
    return Study(values, shown)


def measure(
    kind: str,
    make: Callable[[int], Case],
    methods: Mapping[str, Method],
    seeds: Sequence[int],
    measurements: Measurements,
) -> tuple[Values, Passing]:
    """Track the sequence of every seed once by each method; the seed determines the runs."""
    least = min(len(seeds), 3)  # for an interval
    tracked = {
        name: seeds[: max(len(seeds) // method.one_in, least)] for name, method in methods.items()
    }
    on_scene = partial(_on_scene, make, methods, tracked, seeds[0])
    found = measurements.of_scenes(kind, on_scene, seeds)
    arrays = {tuple(name.split(": ")): each for name, each in found.items()}
    values = {
        (f"{kind}: {what}", name, ""): each
        for (name, what), each in arrays.items()
        if each.ndim == 1
    }
    outlines, ess = (
        {name: arrays[name, what] for name in methods} for what in ("outlines", "ess curve")
    )
    return values, Passing(make(seeds[0]), outlines, ess)


def _on_scene(
    make: Callable[[int], Case],
    methods: Mapping[str, Method],
    tracked: Mapping[str, Sequence[int]],
    first: int,
    seed: int,
) -> dict[str, Any]:
    """Measures and arrays of a ``Passing``, named such as "PS, 750: kept", of a seed's sequence."""
    case = make(seed)
    found: dict[str, Any] = {}
    for name, method in methods.items():
        if seed not in tracked[name]:
            continue
        outcome = track(case, tracker_of(case, method), 1, seed)
        arrays = measures(case, outcome) | {"N": method.num_particles, "ess curve": outcome.ess[0]}
        if method.ordering == "independent":
            # Resampled apart, so that joint particles have equal weights.
            arrays["ess"] = np.nan
        if seed == first:
            arrays["outlines"] = outcome.outlines[0]
        found |= {f"{name}: {what}": each for what, each in arrays.items()}
    return found


#: Labels are judged where more than this share of the farther target is hidden.
MUCH_HIDDEN = 0.2
#: Number of frames just before an occlusion, and frames after it, for comparing spreads.
_BEFORE, _AFTER = 5, slice(5, 10)


def measures(case: Case, outcome: Outcome) -> dict[str, float]:
    """Shares of the runs, effective sample size, and of opaque targets labels and spreads.

    ``widening`` is the farther contour's spread at the height of the occlusion over that before,
    ``narrowing`` its spread some frames after the occlusion over that at the height.  Only runs
    that keep both targets count, because the spread of a lost target means something else; NaN if
    no run does.
    """
    values = {
        "kept": np.mean(outcome.kept),
        "coalesced": np.mean(outcome.coalesced),
        "exchanged": np.mean(outcome.swapped),
        "ess": np.mean(outcome.ess[:, :FIRST_FRAMES]),
    }
    if case.hidden is not None:
        before, hidden, after = _spreads(case, outcome)
        values["label right"] = label_right(case, outcome)
        values |= {"widening": hidden / before, "narrowing": after / hidden}
    return values


def label_right(case: Case, outcome: Outcome) -> float:
    """Share of frames with strong overlap whose more likely label is right."""
    of_front = outcome.in_front if case.farther == 1 else 1 - outcome.in_front
    of_front = of_front[:, case.hidden > MUCH_HIDDEN]
    return float(np.mean(np.where(np.isnan(of_front), np.nan, of_front > 0.5)))


def _spreads(case: Case, outcome: Outcome) -> tuple[float, float, float]:
    """Of the farther contour: before the occlusion, at its height, and some frames after it."""
    spread = outcome.spread[outcome.kept][:, :, case.farther]  # [kept, T]
    if not len(spread):
        return np.nan, np.nan, np.nan
    spread, hidden = spread.mean(axis=0), case.hidden
    covered = np.flatnonzero(hidden > 0)
    first, after = max(covered[0], 1), spread[covered[-1] + 1 :][_AFTER]
    before = spread[max(first - _BEFORE, 0) : first].mean()
    height = spread[hidden > 0.5 * hidden.max()].mean()
    return before, height, after.mean() if len(after) else np.nan


def figures(study: Study) -> dict[str, Figure]:
    """File-name stem -> figure."""
    shown = study.shown
    return {
        "figure_3": line_figure(),
        "figures_9_10": toy_figure(shown["toy"]),
        "figure_11": ess_figure(shown["figure_11"]),
        "figure_4": contours_figure(shown["wires"]),
        "figure_7": contours_figure(shown["leaves"], (PARTITIONED, AS_MANY, ENOUGH)),
        "figures_1_6": contours_figure(shown["walkers"]),
    }


def line_figure() -> Figure:
    """Figure 3 as drawn in the paper: one target above, two below."""
    grid = np.linspace(-80, 80, 161)
    drawing, axes = plotting.new_figure(1, 2, figsize=(11, 4.6))
    left, right = axes[0]
    left.plot(grid, toy.likelihood(grid[None]), color="black")
    left.plot(toy.FEATURES, np.zeros(4), "o", color="gray")
    left.set(xlabel="boundary (pixels along the line)", ylabel="one target, relative to clutter")
    pairs = np.stack(np.meshgrid(grid, grid))
    shown = right.imshow(
        toy.likelihood(pairs), origin="lower", extent=(-80, 80, -80, 80), cmap="gray_r"
    )
    right.plot([-80, 80], [-80, 80], ":", color="gray", lw=1)
    right.set(xlabel="boundary of A (pixels)", ylabel="boundary of B (pixels)", title="two targets")
    drawing.colorbar(shown, ax=right)
    drawing.suptitle("Figure 3 repeated: four features, on each of which one boundary may lie")
    return drawing


def toy_figure(steps: Mapping[str, Sequence[toy.Step]]) -> Figure:
    """All steps of both figures for one run, with y in black and grey."""
    drawing, axes = plotting.new_figure(2, 4, figsize=(16, 8.4))
    for row, (method, shown) in zip(axes, steps.items(), strict=True):
        for axis, step, name in zip(row, shown, toy.STEPS[method], strict=True):
            weights, labels = step.weights[0], step.labels[0]
            axis.scatter(
                *step.substates[0].T, s=1000 * weights, facecolors="none", linewidths=1.2,
                edgecolors=np.where(labels == 0, "black", "darkgray"),
            )  # fmt: skip
            axis.plot(*toy.TARGET, "+", color="red", ms=14, mew=2)
            axis.set(
                xlim=(-3, 3), ylim=(-3, 3), xlabel="A", ylabel="B",
                title=f"{method}: {name}\neffective sample size {step.ess[0]:.1f} of "
                f"{toy.PARTICLES}",
            )  # fmt: skip
            axis.title.set_fontsize(9)
    drawing.suptitle(
        "Figures 9 and 10 repeated: areas are weights, the cross is the target; with branches, "
        "black particles search A first and grey ones B"
    )
    return drawing


def ess_figure(leaves: Passing) -> Figure:
    """Effective sample size over the frames: mean and 95% interval over sequences."""
    drawing, axes = plotting.new_figure(1, 1, figsize=(8, 4.6))
    (axis,) = axes[0]
    for name, colour in zip((PARTITIONED, AS_MANY), plotting.colours(2), strict=True):
        curve = np.array([mean_of(each).measured() for each in leaves.ess[name].T])
        values, lows, highs = curve.T
        of_sequences = counted(len(leaves.ess[name]), "sequences")
        frames = np.arange(1, len(curve) + 1)
        axis.plot(frames, values, color=colour, label=f"{name} ({of_sequences})")
        axis.fill_between(frames, lows, highs, color=colour, alpha=0.2, lw=0)
    axis.set(xlabel="frame", ylabel="effective sample size", ylim=(0, None))
    axis.legend()
    drawing.suptitle("Figure 11 repeated on leaves, every line in full", fontsize=10)
    return drawing


def contours_figure(passing: Passing, methods: Sequence[str] = ()) -> Figure:
    """The estimated contours in three frames of the first sequence.

    Opaque targets are shown before, during and after the occlusion.  Shows all methods, or the
    named ones that were measured.
    """
    case, last = passing.case, len(passing.case.frames) - 1
    middle = round(last / 2) if case.hidden is None else int(case.hidden.argmax())
    shown = [name for name in methods or passing.outlines if name in passing.outlines]
    drawing, axes = plotting.new_figure(len(shown), 3, figsize=(12, 3.2 * len(shown)))
    for row, name in zip(axes, shown, strict=True):
        for axis, time in zip(row, (0, middle, last), strict=True):
            outlines = passing.outlines[name][:, time]
            draw_contours(axis, case.frames[time], outlines, case.space.closed)
            axis.set_title(f"{name}: frame {time}", fontsize=9)
    drawing.suptitle(f"{case.name}: A and B by colour")
    return drawing


def draw_contours(axis: Axes, frame: np.ndarray, outlines: np.ndarray, closed: bool) -> None:
    """Draw contours ``[R, 2, M, 2]`` of several runs on a frame."""
    axis.imshow(frame, extent=(0, frame.shape[1], frame.shape[0], 0))
    for pair in outlines:
        for outline, colour in zip(pair, plotting.colours(2), strict=True):
            line = np.concatenate([outline, outline[:1]]) if closed else outline
            axis.plot(*line.T, color=colour, lw=1, alpha=0.8)
    axis.set(xlim=(0, frame.shape[1]), ylim=(frame.shape[0], 0), xticks=[], yticks=[])


PAPER = Paper(
    "maccormick1999",
    measure_all,
    figures,
    computed=lambda: {"line": [computed(toy.ratio_of_peaks())]},
)
