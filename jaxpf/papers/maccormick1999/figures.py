"""The paper's figures, repeated."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.judging.estimates import mean_of
from jaxpf.papers.maccormick1999 import toy
from jaxpf.papers.maccormick1999.one_line import FEATURES, likelihood
from jaxpf.papers.maccormick1999.passing import AS_MANY, ENOUGH, PARTITIONED, Passing
from jaxpf.papers.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figures(study: Study) -> "dict[str, Figure]":
    """File-name stem -> figure."""
    shown = study.shown
    return {
        "figure_3": line_figure(),
        "figures_9_10": toy_figure(shown["toy"]),
        "figure_11": ess_figure(shown["figure_11"]),
        "figure_4": meeting_figure(shown["wires"]),
        "figure_7": passing_figure(shown["leaves"], (PARTITIONED, AS_MANY, ENOUGH)),
        "figures_1_6": passing_figure(shown["walkers"]),
    }


def line_figure() -> "Figure":
    """Figure 3 as drawn in the paper: one target above, two below."""
    grid = np.linspace(-80, 80, 161)
    drawing, axes = plotting.new_figure(1, 2, figsize=(11, 4.6))
    left, right = axes[0]
    left.plot(grid, likelihood(grid[None]), color="black")
    left.plot(FEATURES, np.zeros(4), "o", color="gray")
    left.set(xlabel="boundary (pixels along the line)", ylabel="one target, relative to clutter")
    pairs = np.stack(np.meshgrid(grid, grid))
    shown = right.imshow(
        likelihood(pairs), origin="lower", extent=(-80, 80, -80, 80), cmap="gray_r"
    )
    right.plot([-80, 80], [-80, 80], ":", color="gray", lw=1)
    right.set(xlabel="boundary of A (pixels)", ylabel="boundary of B (pixels)", title="two targets")
    drawing.colorbar(shown, ax=right)
    drawing.suptitle("Figure 3 repeated: four features, on each of which one boundary may lie")
    return drawing


def toy_figure(steps: Mapping[str, Sequence[toy.Step]]) -> "Figure":
    """All steps of both figures for one run, with y in black and grey."""
    drawing, axes = plotting.new_figure(2, 4, figsize=(16, 8.4))
    for row, (method, shown) in zip(axes, steps.items(), strict=True):
        for axis, step in zip(row, shown, strict=True):
            weights, labels = step.weights[0], step.labels[0]
            axis.scatter(
                *step.substates[0].T, s=1000 * weights, facecolors="none", linewidths=1.2,
                edgecolors=np.where(labels == 0, "black", "darkgray"),
            )  # fmt: skip
            axis.plot(*toy.TARGET, "+", color="red", ms=14, mew=2)
            axis.set(
                xlim=(-3, 3), ylim=(-3, 3), xlabel="A", ylabel="B",
                title=f"{method}: {step.name}\neffective sample size {step.ess[0]:.1f} of "
                f"{toy.PARTICLES}",
            )  # fmt: skip
            axis.title.set_fontsize(9)
    drawing.suptitle(
        "Figures 9 and 10 repeated: areas are weights, the cross is the target; with branches, "
        "black particles search A first and grey ones B"
    )
    return drawing


def ess_figure(leaves: Passing) -> "Figure":
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


def meeting_figure(meeting: Passing) -> "Figure":
    """Three frames of the first sequence with the contours of each likelihood."""
    times = [round(time) for time in np.linspace(0, len(meeting.case.frames) - 1, 3)]
    return _frames_figure(meeting, times, "Figure 4 repeated: A and B by colour")


def passing_figure(passing: Passing, methods: Sequence[str] = ()) -> "Figure":
    """The first sequence before, during and after the occlusion, with the estimated contours.

    Shows all methods, or the named ones that were measured.
    """
    case = passing.case
    times = 0, int(case.hidden.argmax()), len(case.frames) - 1
    if methods:
        kept = {name: passing.outlines[name] for name in methods if name in passing.outlines}
        passing = passing._replace(outlines=kept)
    return _frames_figure(passing, times, f"{case.name}: A and B by colour")


def _frames_figure(passing: Passing, times: Sequence[int], title: str) -> "Figure":
    case, size = passing.case, (12, 3.2 * len(passing.outlines))
    drawing, axes = plotting.new_figure(len(passing.outlines), len(times), figsize=size)
    for row, (name, outlines) in zip(axes, passing.outlines.items(), strict=True):
        for axis, time in zip(row, times, strict=True):
            draw_contours(axis, case.frames[time], outlines[:, time], case.space.closed)
            axis.set_title(f"{name}: frame {time}", fontsize=9)
    drawing.suptitle(title)
    return drawing


def draw_contours(axis: "Axes", frame: np.ndarray, outlines: np.ndarray, closed: bool) -> None:
    """Draw contours ``[R, 2, M, 2]`` of several runs on a frame."""
    axis.imshow(frame, extent=(0, frame.shape[1], frame.shape[0], 0))
    for pair in outlines:
        for outline, colour in zip(pair, plotting.colours(2), strict=True):
            line = np.concatenate([outline, outline[:1]]) if closed else outline
            axis.plot(*line.T, color=colour, lw=1, alpha=0.8)
    axis.set(xlim=(0, frame.shape[1]), ylim=(frame.shape[0], 0), xticks=[], yticks=[])
