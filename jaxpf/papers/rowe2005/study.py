"""rowe2005 repeated: Rowe, Rius, Gonzalez and Villanueva, "Towards robust multiple-target
tracking", about 2005, a particle filter with per-target weight normalisation and speed feedback.

Its synthetic test, two projectiles in front of strips that look like them: figures 2 to 4 and table
1, and its arguments that have no table.  Arrays are of S scenes, R runs, T frames, L targets.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxpf.media import plotting
from jaxpf.papers.checkpoints import Measurements
from jaxpf.papers.paper import Paper
from jaxpf.papers.rowe2005.scenes import RUNS_PER_SCENE, VARIANTS, measure, stability
from jaxpf.papers.study import Study, Values

#: Range of the mean number of samples per target over runs in per cent, figure 2 (b).
SHARE_BAND = (49.5, 50.5)
#: A larger error relative to the target's size counts as a lost target: the published errors are
#: all below .14 or above 2.4.
LOST = 1.0


def measure_all(seeds: range, quick: bool, measurements: Measurements) -> Study:
    """Run all measurements; the figures show the arrays of ``measure``."""
    measurements.report(f"{len(seeds)} scenes with {RUNS_PER_SCENE} runs of every variant each")
    apart = measure(seeds, tuple(VARIANTS), measurements)
    measurements.report("Targets that cross: mean against product")
    crossing = measure(seeds, ("both", "product"), measurements, paths="crossing")
    measurements.report("Condensation on two equal modes")
    return study_of(apart, crossing, np.array([stability(seed) for seed in seeds]))


def study_of(apart: Mapping[str, Any], crossing: Mapping[str, Any], stability: np.ndarray) -> Study:
    """Rows from what ``measure`` returned, for all variants and for targets that cross.

    ``stability`` ``[S]`` is that of ``modes``.
    """
    values: Values = {}
    values["between over within", "Condensation", "two modes"] = stability
    for variant, runs in apart.items():
        values |= {(name, variant, ""): each for name, each in measures(runs).items()}
        for run, shares in enumerate(runs["share"][..., 0].mean(axis=-1).T):
            values["share of a run", variant, f"{run + 1}"] = 100 * shares
    for variant, runs in crossing.items():
        values["lost where crossing", variant, ""] = measures(runs)["lost"]
    return Study(values, shown=apart)


def measures(runs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Measure -> ``[S]``, of the arrays that ``scenes.measure`` returns for a variant."""
    error, ratio, share = runs["error"], runs["area_ratio"], runs["share"]
    # The first target's share of the particles, mean over frames.
    shares = 100 * share[..., 0].mean(axis=-1)
    return {
        "share": shares.mean(axis=1),
        "in band": np.mean((SHARE_BAND[0] <= shares) & (shares <= SHARE_BAND[1]), axis=1),
        "starved": (share[:, :, -1] == 0).any(axis=-1).mean(axis=1),
        "error": tracked_error(error),
        "error at a strip": _mean_where(runs["in_strip"], error),
        "error elsewhere": _mean_where(~runs["in_strip"], error),
        "lost": lost(error).mean(axis=1),
        "samples lost": 100 * runs["astray"].mean(axis=(1, 2)),
        "side": last_side(ratio),
        "between": 100 * runs["between"],
        "within": 100 * runs["within"],
    }


def lost(error: np.ndarray) -> np.ndarray:
    """``[S, R L]`` bool: targets whose mean error ``[S, R, T, L]`` is above ``LOST``."""
    return (error.mean(axis=2) > LOST).reshape(len(error), -1)


def tracked_error(error: np.ndarray) -> np.ndarray:
    """``[S]``: mean error of a scene's targets that were not lost; NaN if all were lost."""
    mean = error.mean(axis=2).reshape(len(error), -1)
    kept = ~lost(error)
    total = np.where(kept, mean, 0.0).sum(axis=1)
    return np.where(kept.any(axis=1), total / np.maximum(kept.sum(axis=1), 1), np.nan)


def last_side(ratio: np.ndarray) -> np.ndarray:
    """``[S]``: root of estimated over true area in the last tenth of the frames, lost or not.

    Geometric mean over runs, targets and frames.
    """
    late = ratio[:, :, -max(ratio.shape[2] // 10, 1) :]
    return np.exp(np.log(np.maximum(late, 1e-6)).mean(axis=(1, 2, 3)) / 2)


def _mean_where(counts: np.ndarray, error: np.ndarray) -> np.ndarray:
    """``[S]``: mean error over the frames that count, ``[S, T, L]`` bool."""
    counts = np.broadcast_to(counts[:, None], error.shape)
    total, number = np.where(counts, error, 0.0).sum(axis=(1, 2, 3)), counts.sum(axis=(1, 2, 3))
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def figures(study: Study) -> dict[str, Figure]:
    """File-name stem -> figure."""
    shown = study.shown
    return {
        "figure_2": figure_2({name: shown[name]["share"] for name in ("without eq. 4", "both")}),
        "figure_3": figure_3({name: shown[name]["astray"] for name in ("neither", "both")}),
        "figure_4": figure_4(shown["both"]["area_ratio"]),
    }


def figure_2(shares: dict[str, np.ndarray]) -> Figure:
    """Share of samples on target 1 per frame: the first run of every scene."""
    figure, axes = plotting.new_figure(1, 2, figsize=(10, 3.6))
    titles = ("without eq. 4", "with eq. 4")
    for axis, share, title in zip(axes[0], shares.values(), titles, strict=True):
        of_first = 100 * share[:, 0, :, 0].T
        axis.plot(np.arange(1, len(of_first) + 1), of_first, linewidth=0.7)
        axis.set(title=title, xlabel="frame", ylabel="samples on target 1 (%)", ylim=(-2, 102))
    return figure


def figure_3(astray: dict[str, np.ndarray]) -> Figure:
    """Share of lost samples per frame, mean over runs."""
    figure, axes = plotting.new_figure(figsize=(7, 3.6))
    axis = axes[0, 0]
    for (variant, shares), colour in zip(astray.items(), plotting.colours(2), strict=True):
        curve = 100 * shares.mean(axis=(0, 1))
        axis.plot(np.arange(1, len(curve) + 1), curve, color=colour, label=variant)
    axis.set(xlabel="frame", ylabel="lost samples (%)")
    axis.legend(title="regularising and feedback")
    return figure


def figure_4(ratio: np.ndarray) -> Figure:
    """Error of the area in six runs, both targets."""
    figure, axes = plotting.new_figure(figsize=(7, 3.6))
    axis = axes[0, 0]
    for run in ratio.reshape(-1, *ratio.shape[2:])[:6]:
        axis.plot(np.arange(1, len(run) + 1), 100 * (run - 1), linewidth=0.7)
    axis.set(xlabel="frame", ylabel="error of the area (%)", ylim=(-100, 200))
    return figure


PAPER = Paper("rowe2005", measure_all, figures)
