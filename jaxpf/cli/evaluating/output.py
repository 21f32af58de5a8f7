"""Printed output of ``jaxpf evaluate``: the plan before a run, and tables after it."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxpf.cli.shared.console import print_table, say
from jaxpf.contract.options import chosen, counting, plain
from jaxpf.files.writing import write_text

if TYPE_CHECKING:
    from jaxpf.evaluation.measuring.overview import Overview
    from jaxpf.evaluation.work.engine import Prepared
    from jaxpf.evaluation.work.results import Results

#: The printed output of a finished evaluation; written last, after tables and report.
FINISHED = "finished.json"
#: Output files that the last line lists.
_WRITTEN = (
    "report.html",
    "results.csv",
    "summary.csv",
    "summary.md",
    "curves.csv",
    "run.toml",
)


def show_plan(prepared: "Prepared", workers: int, devices: int) -> None:
    """Print what is compared, and its cost."""
    from jaxpf.evaluation.work.results import OWN

    results, scene = prepared.results, prepared.results.settings["scene"]
    count, frames = len(scene["object_ids"]), len(results.truth)
    say(
        f"{scene['name']}: {count} object{'s' if count != 1 else ''}, {frames} frames "
        f"after the start frame {scene['start_frame']}, {scene['width']} x {scene['height']} pixels"
    )
    columns, rows, common_to_all = _plan_table(prepared)
    print_table("Plan", columns, rows)
    if common_to_all:
        say(", ".join(f"{name} {value}" for name, value in common_to_all.items()))
    if prepared.damaged:
        say(f"{len(prepared.damaged)} damaged file(s) will be made again.")
    has_own = any(each.kind == OWN for each in results.configurations)
    place = f"on {devices} device{'s' if devices > 1 else ''}"
    if workers > 1:
        place = f"in each of {workers} processes {place}"
    say(
        f"{prepared.missing_runs} runs to do, with {prepared.memory / 2**30:.1f} GB of memory "
        + place
        + (", trackers of your own not counted" if has_own else "")
    )


def _plan_table(prepared: "Prepared") -> tuple[list[str], list[list[str]], dict[str, str]]:
    """A row per method, and the parameters that all configurations share."""
    of, configurations = prepared.target, prepared.results.configurations
    by_method: dict[str, list[int]] = {}
    values: dict[str, dict[str, None]] = {}
    for index, configuration in enumerate(configurations):
        by_method.setdefault(configuration.method, []).append(index)
        counts = counting(chosen(of.options, configuration.parameters))
        for name, value in configuration.parameters.items():
            if counts.get(name, True):
                values.setdefault(name, {})[plain(value)] = None
    varied = [name for name, texts in values.items() if len(texts) > 1]
    rows = []
    for method, indices in by_method.items():
        group = [configurations[index] for index in indices]
        orderings = " ".join(dict.fromkeys(c.ordering for c in group))
        cells = [" ".join(values[name]) if name in group[0].parameters else "" for name in varied]
        runs = 1 if group[0].is_imported else prepared.plan.runs
        done = sum(int(prepared.done[index].sum()) for index in indices)
        rows.append([method, orderings, *cells, f"{len(group)} x {runs}", str(done)])
    common_to_all = {name: next(iter(values[name])) for name in values if name not in varied}
    common_to_all = {n: value for n, value in common_to_all.items() if value != plain(None)}
    return ["method", "ordering", *varied, "runs", "done"], rows, common_to_all


def print_results(results: "Results", overview: "Overview") -> None:
    """Print the summary and store it for ``print_again``."""
    from jaxpf.evaluation.output.tables import printed_tables

    printed = {
        "runs": results.runs,
        "tables": [
            {"title": table.title, "columns": table.columns, "rows": table.texts()}
            for table in printed_tables(results, overview)
        ],
        "remarks": list(overview.remarks),
        "conclusion": overview.conclusion,
    }
    write_text(results.folder / FINISHED, json.dumps(printed))
    _print(results.folder, printed)


def print_again(folder: Path, runs: int) -> bool:
    """Print a finished evaluation's output again; False if a file is missing or has fewer runs."""
    try:
        printed = json.loads((folder / FINISHED).read_text(encoding="utf-8"))
        whole = printed.keys() >= {"runs", "tables", "remarks", "conclusion"}
    except (OSError, ValueError, RecursionError, AttributeError):
        return False
    if (
        not whole
        or printed["runs"] != runs
        or not all((folder / name).is_file() for name in _WRITTEN)
    ):
        return False
    _print(folder, printed)
    return True


def _print(folder: Path, printed: dict[str, Any]) -> None:
    for table in printed["tables"]:
        print_table(table["title"], table["columns"], table["rows"])
    for remark in printed["remarks"]:
        say(remark)
    say(f"{folder}/: {', '.join(_WRITTEN)}")
    say(printed["conclusion"])
