"""The settings of an evaluation: what determines its results, stored and compared on resuming."""

import dataclasses
import functools
import hashlib
import inspect
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import OPEN, applying
from jaxpf.evaluation.plan import Plan, configurations
from jaxpf.evaluation.results import IMPORTED, OWN, TRUTH, Configuration, read_settings
from jaxpf.evaluation.scene import Opened, object_ids, start_frame
from jaxpf.evaluation.trackers import looks_of
from jaxpf.files.store import SETTINGS, Store, versions
from jaxpf.files.writing import is_left_over, report_os_errors
from jaxpf.targets.target import Start, Target


def stored_settings(folder: Path) -> dict[str, Any] | None:
    """The settings of the evaluation in a folder; None if it is new or empty.

    Remains of an interrupted start are allowed.

    Raises:
        InputError: the folder holds something else.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"'{folder}' is a file; choose another output folder.")
    if (folder / SETTINGS).exists():
        return read_settings(folder)
    if folder.exists():
        with report_os_errors("read the folder", folder):
            names = sorted(os.listdir(folder))
        for name in names:
            if not (name == f"{TRUTH}.npz" or is_left_over(folder / name)):
                raise InputError(
                    f"'{folder}' holds '{name}' but no evaluation ('{SETTINGS}' is missing); "
                    "choose another output folder."
                )
    return None


def resumed(folder: Path, old: dict[str, Any], plan: Plan) -> dict[str, Any]:
    """The settings of an evaluation that a complete plan goes on with, perhaps with more runs.

    Raises:
        InputError: the evaluation is of another version or has other settings.
    """
    now = _of_plan(plan) | {"runs": min(plan.runs, old["runs"])}
    Store(folder).check_same(_compared(old), _compared(now))
    return old | {"runs": plan.runs}


def _compared(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What must be the same on resuming."""
    precision = "double" if settings["float64"] else "single"
    own = {"jaxpf": settings["versions"].get("jaxpf"), "precision": precision}
    return {**own, **settings["asked"], "runs": settings["runs"]}


def new_settings(plan: Plan, opened: Opened, start: Start) -> dict[str, Any]:
    """The settings of an evaluation that begins with a complete plan.

    Raises:
        InputError: see ``configurations``; a user-defined tracker cannot be made.
    """
    scene = opened.scene

    def settle(of: Target, values: dict[str, Any], num_particles: int) -> dict[str, Any]:
        # Independent of the number of runs, because these options determine the results.
        looks = looks_of(scene, num_particles)
        values = of.settle(values, looks.settings)
        if applying(values, of.tracker).get("likelihood") == OPEN:
            made = inspect.unwrap(of.tracker)(looks, start, **values)
            values["likelihood"] = made.likelihood.method
        return values

    listed = configurations(plan, start, settle)
    for name, function in plan.trackers.items():
        fixed = isinstance(opened.made(name, function)[0], np.ndarray)
        listed.append(Configuration(name, kind=IMPORTED if fixed else OWN))
    listed += [Configuration(name, kind=IMPORTED) for name in plan.tracks]
    return _of_plan(plan) | {
        "scene": {
            "name": scene.name,
            "target": plan.target,
            "parents": list(start.parents),
            "object_ids": object_ids(scene),
            "start_frame": start_frame(scene),
            "fps": float(scene.fps),
            "num_frames": len(scene.frames),
            "width": scene.frames.shape[2],
            "height": scene.frames.shape[1],
            "digest": opened.digest,
        },
        "configurations": [dataclasses.asdict(each) for each in listed],
    }


def _of_plan(plan: Plan) -> dict[str, Any]:
    """What the plan, the program and JAX determine."""
    return {
        "versions": versions(),
        "asked": describe_plan(plan),
        "runs": plan.runs,
        "float64": jnp.zeros(()).dtype == jnp.float64,
    }


def describe_plan(plan: Plan) -> dict[str, Any]:
    """Everything that determines the results except the number of runs, as JSON values.

    Raises:
        InputError: a file of ``tracks`` cannot be read.
    """
    described = {
        "scene": _described(plan.scene),
        **{name: getattr(plan, name) for name in ("target", "methods", "orders", "swaps", "grid")},
        "seed": plan.seed,
        "tracks": {name: _file(path) for name, path in plan.tracks.items()},
        "trackers": {name: _function(each) for name, each in plan.trackers.items()},
    }
    return json.loads(json.dumps(described, default=_text))


def _described(scene: Any) -> dict[str, Any]:
    """A scene, or the function that opens it."""
    if isinstance(scene, functools.partial):
        arguments = {"arguments": scene.args} if scene.args else {}
        return _described(scene.func) | arguments | scene.keywords
    if callable(scene):
        name = getattr(scene, "__qualname__", type(scene).__qualname__)
        return {"function": f"{scene.__module__}.{name}"}
    return {"name": scene.name, "parameters": scene.parameters}


def _function(function: Callable[..., Any]) -> dict[str, Any]:
    """A user's function, with the digest of its source if it has one."""
    digest = getattr(function, "sha256", None)
    return _described(function) | ({"sha256": digest} if digest else {})


def _file(path: str | os.PathLike[str]) -> dict[str, str]:
    with report_os_errors("read", path):
        content = Path(path).read_bytes()
    return {"file": os.fspath(path), "sha256": hashlib.sha256(content).hexdigest()}


def _text(value: object) -> str:
    """What JSON does not know."""
    return os.fspath(value) if isinstance(value, os.PathLike) else repr(value)
