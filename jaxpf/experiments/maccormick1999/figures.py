"""The paper's figures, repeated."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxpf.experiments.maccormick1999 import toy
from jaxpf.experiments.maccormick1999.measure import Found
from jaxpf.experiments.maccormick1999.one_line import likelihood
from jaxpf.experiments.maccormick1999.passing import Passing
from jaxpf.experiments.maccormick1999.published import FEATURES
from jaxpf.media import plotting


def figures(found: Found) -> dict[str, Any]:
    """All figures by the stem of their files."""
    return {
        "figure_3": line_figure(),
        "figures_9_10": toy_figure(found.toy),
        **{f"figure_4_{meeting.name}": meeting_figure(meeting) for meeting in found.meetings},
        "figure_7": passing_figure(found.leaves),
        "figures_1_6": passing_figure(found.walkers),
    }


def line_figure() -> Any:
    """One target above, two below, as the paper draws them."""
    grid = np.linspace(-80, 80, 161)
    drawing, axes = plotting.new_figure(1, 2, figsize=(11, 4.6))
    one, two = axes[0]
    one.plot(grid, likelihood(grid[None]), color="black")
    one.plot(FEATURES, np.zeros(4), "o", color="gray")
    one.set(xlabel="boundary (pixels along the line)", ylabel="one target, relative to clutter")
    pairs = np.stack(np.meshgrid(grid, grid))
    shown = two.imshow(likelihood(pairs), origin="lower", extent=(-80, 80, -80, 80), cmap="gray_r")
    two.plot([-80, 80], [-80, 80], ":", color="gray", lw=1)
    two.set(xlabel="boundary of A (pixels)", ylabel="boundary of B (pixels)", title="two targets")
    drawing.colorbar(shown, ax=two)
    drawing.suptitle("Figure 3 repeated: four features, on each of which one boundary may lie")
    return drawing


def toy_figure(sets: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Any:
    """The last step of both figures, of one run."""
    drawing, axes = plotting.new_figure(1, 2, figsize=(10, 4.8))
    for axis, (name, (substates, weights)) in zip(axes[0], sets.items(), strict=True):
        a, b = substates[0].T
        ess = 1 / np.sum(weights[0] ** 2)
        axis.scatter(a, b, s=4000 * weights[0] / 4, facecolors="none", edgecolors="black")
        axis.plot(*toy.TARGET, "+", color="red", ms=14, mew=2)
        axis.set(
            xlim=(-3, 3), ylim=(-3, 3), xlabel="A", ylabel="B",
            title=f"{name}: effective sample size {ess:.1f} of {toy.PARTICLES}",
        )  # fmt: skip
    drawing.suptitle("Figures 9 and 10 repeated: areas are weights, the cross is the target")
    return drawing


def meeting_figure(meeting: Passing, num_runs: int = 5) -> Any:
    """Three frames of the first case with the contours of several runs, by each likelihood."""
    times = [round(time) for time in np.linspace(0, len(meeting.cases[0].frames) - 1, 3)]
    title = f"Figure 4 repeated on {meeting.name}: {num_runs} runs, A and B by colour"
    return _frames_figure(meeting, times, title, 6.4, num_runs)


def passing_figure(passing: Passing, num_runs: int = 5) -> Any:
    """The first sequence before, in and after the occlusion, with contours of several runs."""
    case = passing.cases[0]
    times = 0, int(case.hidden.argmax()), len(case.frames) - 1
    runs = min(num_runs, passing.kept(next(iter(passing.methods))).shape[1])
    title = f"{case.name}: {runs} run(s), A and B by colour"
    return _frames_figure(passing, times, title, 3.2 * len(passing.methods), num_runs)


def _frames_figure(
    passing: Passing, times: Sequence[int], title: str, height: float, num_runs: int
) -> Any:
    case = passing.cases[0]
    drawing, axes = plotting.new_figure(len(passing.methods), len(times), figsize=(12, height))
    for row, name in zip(axes, passing.methods, strict=True):
        outlines = passing.outcomes[name][0].outlines[:num_runs]
        for axis, time in zip(row, times, strict=True):
            draw_contours(axis, case.frames[time], outlines[:, time], case.space.closed)
            axis.set_title(f"{name}: frame {time}", fontsize=9)
    drawing.suptitle(title)
    return drawing


def draw_contours(axis: Any, frame: np.ndarray, outlines: np.ndarray, closed: bool) -> None:
    """A frame with contours ``[R, 2, M, 2]`` of several runs."""
    axis.imshow(frame, extent=(0, frame.shape[1], frame.shape[0], 0))
    for pair in outlines:
        for outline, colour in zip(pair, plotting.colours(2), strict=True):
            line = np.concatenate([outline, outline[:1]]) if closed else outline
            axis.plot(*line.T, color=colour, lw=1, alpha=0.8)
    axis.set(xlim=(0, frame.shape[1]), ylim=(frame.shape[0], 0), xticks=[], yticks=[])
