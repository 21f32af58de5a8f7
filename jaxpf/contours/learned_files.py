"""Files of learned contour models: a shape space and its dynamics.

JSON, as ``jaxpf contour learn`` writes it and ``jaxpf track --learned`` reads it.  ``"space"``
holds the arrays of ``jaxpf.shapes.ShapeSpace``; ``"dynamics"``, unless null, those of
``jaxpf.dynamics.LinearGaussian``; both for one target.  All targets of a run share them.
"""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contours.data import MATRICES, Learned
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import as_array
from jaxpf.dynamics.gaussian import LinearGaussian
from jaxpf.files.reading import read_text
from jaxpf.files.writing import write_text
from jaxpf.shapes.spaces import ShapeSpace

if TYPE_CHECKING:
    from jax.typing import ArrayLike


def write_learned(path: str | os.PathLike[str], learned: Learned) -> None:
    """Write a file that ``read_learned`` reads."""
    space = learned.space
    about = {
        "closed": space.closed,
        "degree": space.degree,
        "template": _list(space.template)[0],
        "modes": _list(space.modes)[0],
    }
    moves = learned.dynamics
    dynamics = moves and {
        name: None if getattr(moves, name) is None else _list(getattr(moves, name)[0])
        for name in MATRICES
    }
    content = {"space": about, "dynamics": dynamics}
    write_text(path, json.dumps(content, indent=1) + "\n")


def read_learned(path: str | os.PathLike[str]) -> Learned:
    """Read a file that ``write_learned`` wrote.

    Raises:
        InputError: the file is missing or has other content.
    """
    path = Path(path)
    text = read_text(path, "a learned shape space", "one that `jaxpf contour learn` wrote")
    try:
        content = json.loads(text)
        space = _space(content["space"])
        return Learned(space, _dynamics(content.get("dynamics"), space.dimension))
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        RecursionError,
        TypeError,
        ValueError,
    ) as e:
        cause = f"it has no {e}" if isinstance(e, KeyError) else str(e).splitlines()[0]
        raise InputError(
            f"'{path}' is not a file of a learned shape space ({cause}); write one with "
            "`jaxpf contour learn`."
        ) from None


def _space(about: dict[str, Any]) -> ShapeSpace:
    degree, modes = int(about["degree"]), about["modes"]
    template = np.asarray(about["template"], float)
    count = len(template)
    if count <= degree:
        raise ValueError(f"{count} control points are too few for degree {degree}")
    return ShapeSpace(
        template=as_array(_numbers("template", template, (count, 2))[None], float),
        modes=as_array(_numbers("modes", modes, (len(modes), count, 2))[None], float),
        closed=bool(about["closed"]),
        degree=degree,
    )


def _dynamics(about: dict[str, Any] | None, size: int) -> LinearGaussian | None:
    if about is None:
        return None
    shapes = {name: (size,) if name == "offset" else (size, size) for name in MATRICES}
    fields: dict[str, Any] = {
        name: None
        if about[name] is None and name in ("lag", "offset")
        else as_array(_numbers(name, about[name], shape)[None], float)
        for name, shape in shapes.items()
    }
    return LinearGaussian(**fields)


def _numbers(name: str, values: object, shape: tuple[int, ...]) -> np.ndarray:
    array = np.asarray(values, float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite numbers of shape {list(shape)}")
    return array


def _list(values: "ArrayLike") -> Any:
    return np.asarray(values, float).tolist()
