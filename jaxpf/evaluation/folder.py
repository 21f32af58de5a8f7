"""Manages an evaluation's folder: its settings, and whether a plan may resume it."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf import __version__
from jaxpf.contract.errors import InputError
from jaxpf.evaluation.batches import FOLDER
from jaxpf.evaluation.configurations import complete
from jaxpf.evaluation.fingerprint import describe_plan
from jaxpf.evaluation.plan import Plan
from jaxpf.evaluation.results import TRUTH, read_settings
from jaxpf.files.store import SETTINGS, Store, differences
from jaxpf.files.writing import is_left_over, report_os_errors
from jaxpf.targets.target import Start


def stored_settings(plan: Plan, folder: Path) -> dict[str, Any] | None:
    """The settings of the evaluation that ``plan`` resumes; None if the evaluation is new.

    Raises:
        InputError: the folder holds something else, or an evaluation of another version or with
            other settings.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"'{folder}' is a file; choose another output folder.")
    if not (folder / SETTINGS).exists():
        _check_empty(folder)
        return None
    settings = read_settings(folder)
    version = settings.get("versions", {}).get("jaxpf")
    if version != __version__:
        raise InputError(
            f"the evaluation in '{folder}' was made by jaxpf {version} and this is jaxpf "
            f"{__version__}, which may give other results; choose another output folder, or "
            "continue with that version."
        )
    scene = settings["scene"]
    plan = complete(plan, scene["target"], scene["parents"])
    change = _change(settings["asked"], describe_plan(plan))
    if change is not None:
        raise InputError(
            f"the evaluation in '{folder}' was begun with {change}; choose another output folder, "
            "or ask for the same (only `runs` may grow)."
        )
    if plan.runs < settings["runs"]:
        raise InputError(
            f"the evaluation in '{folder}' was begun with runs = {settings['runs']}, now "
            f"{plan.runs}; choose another output folder, or ask for at least as many."
        )
    return settings


def _change(before: dict[str, Any], now: dict[str, Any]) -> str | None:
    """Describe the first difference between stored and requested settings; None if equal."""
    for kind in ("trackers", "tracks"):
        old, new = before.get(kind, {}), now.get(kind, {})
        for name in dict.fromkeys([*old, *new]):
            if old.get(name) != new.get(name):
                return f"other {kind}: {name!r} is new, missing or changed"
    return next(iter(differences(before, now)), None)


def write_settings(folder: Path, settings: dict[str, Any], truth: np.ndarray, start: Start) -> None:
    """Start or resume an evaluation; settings are written last, because they mark the folder.

    Raises:
        InputError: the folder or the files cannot be written.
    """
    with report_os_errors("create the folder", folder):
        (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    store = Store(folder)
    if not store.path(TRUTH).exists():
        store.write(TRUTH, {"truth": truth, "start": start.shapes, "sizes": start.sizes})
    store.begin(settings)


def _check_empty(folder: Path) -> None:
    """Reject a folder with foreign files; remains of an interrupted start are allowed."""
    if not folder.is_dir():
        return
    with report_os_errors("read the folder", folder):
        names = sorted(os.listdir(folder))
    for name in names:
        if not (name == f"{TRUTH}.npz" or is_left_over(folder / name)):
            raise InputError(
                f"'{folder}' holds '{name}' but no evaluation ('{SETTINGS}' is missing); choose "
                "another output folder."
            )
