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
from jaxpf.evaluation.plan import Plan, complete, configurations
from jaxpf.evaluation.results import (
    FOLDER,
    IMPORTED,
    OWN,
    TRUTH,
    Configuration,
    Results,
    read_settings,
)
from jaxpf.evaluation.scene import object_ids, start_frame
from jaxpf.evaluation.trackers import looks_of
from jaxpf.files.store import SETTINGS, Store, versions
from jaxpf.files.writing import is_left_over, report_os_errors
from jaxpf.targets.target import Start, Target
from scenes import Scene


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
    plan = complete(plan, settings["scene"]["target"], settings["scene"]["parents"])
    runs = min(plan.runs, settings["runs"])  # may grow
    now = {"versions": versions(), "asked": describe_plan(plan), "float64": double_precision()}
    Store(folder).check_same(_compared(settings), _compared({**now, "runs": runs}))
    return {**settings, "runs": plan.runs}


def _compared(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What must be the same on resuming."""
    precision = "double" if settings["float64"] else "single"
    own = {"jaxpf": settings["versions"].get("jaxpf"), "precision": precision}
    return {**own, **settings["asked"], "runs": settings["runs"]}


def new_settings(
    plan: Plan,
    scene: Scene,
    digest: str,
    of: Target,
    start: Start,
    own: Callable[[str], Any],
) -> dict[str, Any]:
    """Make the content of ``settings.json``.

    Args:
        plan: of the evaluation.
        scene: of the plan.
        digest: of the scene.
        of: the target.
        start: of the scene.
        own: name of a user-defined tracker -> what its function made of the scene.

    Raises:
        InputError: see ``configurations``; a user-defined tracker cannot be made.
    """
    plan = complete(plan, of.name, start.parents)

    def settle(of: Target, values: dict[str, Any], num_particles: int) -> dict[str, Any]:
        # Independent of the number of runs, because these options determine the results.
        looks = looks_of(scene, num_particles)
        values = of.settle(values, looks.settings)
        if applying(values, of.tracker).get("likelihood") == OPEN:
            made = inspect.unwrap(of.tracker)(looks, start, **values)
            values["likelihood"] = made.likelihood.method
        return values

    listed = configurations(plan, start, settle)
    for name in plan.trackers:
        fixed = isinstance(own(name), np.ndarray)
        listed.append(Configuration(name, kind=IMPORTED if fixed else OWN))
    listed += [Configuration(name, kind=IMPORTED) for name in plan.tracks]
    return {
        "versions": versions(),
        "asked": describe_plan(plan),
        "runs": plan.runs,
        "float64": double_precision(),
        "scene": {
            "name": scene.name,
            "target": of.name,
            "parents": list(start.parents),
            "object_ids": object_ids(scene),
            "start_frame": start_frame(scene),
            "fps": float(scene.fps),
            "num_frames": len(scene.frames),
            "width": scene.frames.shape[2],
            "height": scene.frames.shape[1],
            "digest": digest,
        },
        "configurations": [dataclasses.asdict(each) for each in listed],
    }


def write_settings(results: Results) -> None:
    """Start or resume an evaluation; settings are written last, because they mark the folder.

    Raises:
        InputError: the folder or the files cannot be written.
    """
    with report_os_errors("create the folder", results.folder):
        (results.folder / FOLDER).mkdir(parents=True, exist_ok=True)
    store, start = Store(results.folder), results.start
    if not store.path(TRUTH).exists():
        store.write(TRUTH, {"truth": results.truth, "start": start.shapes, "sizes": start.sizes})
    store.begin(results.settings)


def double_precision() -> bool:
    """Whether JAX computes in double precision."""
    return jnp.zeros(()).dtype == jnp.float64


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
