"""Output of `jaxpf tune`: values and traces."""

from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import ArrayLike

from jaxpf.cli.shared.console import print_table, say
from jaxpf.contract.options import defaults_of, options_of
from jaxpf.files.writing import atomic_write
from jaxpf.media.plotting import save_figure
from jaxpf.targets.registry import DEFAULT
from jaxpf.tuning.plot import traces
from jaxpf.tuning.result import Result
from jaxpf.tuning.sequences import Recipe

TUNED, TRACES = "tuned.toml", "tuning.png"


def write_tuned(path: Path, result: Result, values: dict[str, Any], before: Recipe) -> None:
    """Write the values as options of `track` and `evaluate`, with their uncertainty."""
    after = before.with_values(values)
    named = {path.partition("[")[0] for path in values}
    track: dict[str, Any] = {}  # `jaxpf track` defaults to boxes
    for name, option in options_of(after.of.tracker).items():
        if option.path in named:
            track[name] = _numbers(after.values[name])
    # A sharpness belongs to an appearance, which synthetic scenes set.
    appearance = after.values.get("appearance")
    usual = after.of.settle(defaults_of(after.of.tracker), {}).get("appearance")
    if "sharpness" in track and appearance != usual:
        track["appearance"] = appearance
    evaluate = {name: [value] for name, value in track.items()}
    if after.of.name != DEFAULT:
        track = {"target": after.of.name, **track}
    tuned = {
        name: {"value": _numbers(value), "start": _numbers(result.start[name])}
        for name, value in values.items()
    }
    for name, error in result.standard_errors().items():
        if np.all(np.isfinite(error)):  # NaN for one repeat without curvature
            tuned[name]["standard_error"] = _numbers(error)
    with atomic_write(path, "wb") as file:
        tomli_w.dump({"track": track, "evaluate": evaluate, "tuned": tuned}, file)
        for remark in result.remarks:
            file.write(f"# {remark}\n".encode())


def _numbers(value: ArrayLike) -> Any:
    """Round to six digits, for TOML."""
    return np.vectorize(lambda x: float(f"{x:.6g}"))(np.asarray(value, float)).tolist()


def write_traces(path: Path, result: Result, objective: str) -> None:
    """Write the figure of the descents."""
    names = {
        "evidence": "- log evidence per frame",
        "position": "distance (pixels)",
        "iou": "1 - IoU",
        "crps": "CRPS (pixels)",
    }
    save_figure(traces(result, names[objective]), path)


def show(result: Result) -> None:
    """Print the table of values, and how the descents ended."""
    intervals, rows = result.intervals(), []
    for parameter in result.parameters:
        path = parameter.path
        each = (result.start, result.values, result.spread_errors, result.curvature_errors)
        columns = [*(values[path] for values in each), *intervals[path]]
        for index in np.ndindex(np.shape(columns[0])):
            start, value, spread, curvature, low, high = (float(x[index]) for x in columns)
            suffix = "".join(f"[{i}]" for i in index)
            rows.append(
                [
                    f"{path}{suffix}",
                    f"{start:.4g}",
                    f"{value:.4g}",
                    f"[{low:.4g}, {high:.4g}]" if high > low else "",
                    *("" if np.isnan(x) else f"{100 * x:.1f}%" for x in (spread, curvature)),
                ]
            )
    print_table(
        "Tuned values",
        ["", "start", "tuned", "95% interval", "error of repeats", "error of frames"],
        rows,
    )
    for descent in result.descents:
        how = {"settled": "settled", "all steps": "stopped before it settled"}[descent.stopped]
        say(f"repeat {descent.repeat + 1}: {how} after {descent.num_steps} steps")
    for remark in result.remarks:
        say(remark)
