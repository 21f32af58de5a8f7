"""Parameters of a tracker, named by their path: ``likelihood.sharpness``, ``dynamics.scale[0]``."""

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.types import TrackerLike

_PATH = re.compile(r"(?P<name>[A-Za-z_][\w.]*)(?P<index>(\[\d+\])*)")
#: Fields of a tracker whose floats are whole numbers in disguise.
_NO_PARAMETERS = ("ordering",)


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One parameter, or an array of them, and its bounds.

    Attributes:
        path: attribute names from the tracker down, joined by dots, with an optional index:
            ``dynamics.scale[0]`` of an array ``[3]`` or ``[P, 3]``.
        low: exclusive lower bound; -inf for none.
        high: exclusive upper bound; inf for none.
    """

    path: str
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        if not _PATH.fullmatch(self.path):
            raise InputError(
                f"the parameter {self.path!r} is not a path; write names joined by dots, such as "
                "likelihood.sharpness or dynamics.scale[0]."
            )
        if not self.low < self.high:
            raise InputError(
                f"the bounds of {self.path} are {self.low:g} and {self.high:g}: the first must be "
                "the smaller."
            )

    @property
    def name(self) -> str:
        """The path without its index."""
        return self.path.partition("[")[0]

    @property
    def index(self) -> tuple[int, ...]:
        """The index; () if there is none."""
        return tuple(int(number) for number in re.findall(r"\[(\d+)\]", self.path))

    @property
    def _is_unbounded(self) -> bool:
        return math.isinf(self.low) and math.isinf(self.high)

    # The optimiser works on unconstrained numbers z: x = low + e^z, or a logistic curve between
    # bounds.

    def to_free(self, value: ArrayLike) -> jax.Array:
        """Map a value within the bounds to its unconstrained number z."""
        value = jnp.asarray(value, float)
        if self._is_unbounded:
            return value
        if math.isinf(self.high):
            return jnp.log(value - self.low)
        if math.isinf(self.low):
            return -jnp.log(self.high - value)
        return jnp.log(value - self.low) - jnp.log(self.high - value)

    def to_value(self, free: ArrayLike) -> jax.Array:
        """Map an unconstrained number to its value."""
        free = jnp.asarray(free)
        if self._is_unbounded:
            return free
        if math.isinf(self.high):
            return self.low + jnp.exp(free)
        if math.isinf(self.low):
            return self.high - jnp.exp(-free)
        return self.low + (self.high - self.low) * jax.nn.sigmoid(free)

    def slope(self, free: ArrayLike) -> jax.Array:
        """d value / d free."""
        free = jnp.asarray(free, float)
        derivative = jax.grad(lambda z: jnp.sum(self.to_value(z)))
        return derivative(free)


#: Default bounds by parameter name.
DEFAULT_BOUNDS = {
    "sharpness": (0.0, math.inf),
    "sigma": (0.0, math.inf),
    "scale": (0.0, math.inf),
    "steps": (0.0, math.inf),
    "joint_scale": (0.0, math.inf),
    "momentum": (0.0, 1.0),
    "tempering": (0.0, 1.0),
}


def parameter(text: str) -> Parameter:
    """Parse ``PATH`` or ``PATH=LOW:HIGH``; either bound may be omitted."""
    path, equals, bounds = (part.strip() for part in text.partition("="))
    if not equals:
        last = path.partition("[")[0].rpartition(".")[2]
        return Parameter(path, *DEFAULT_BOUNDS.get(last, ()))
    low, colon, high = bounds.partition(":")
    try:
        if not colon:
            raise ValueError
        return Parameter(path, float(low or -math.inf), float(high or math.inf))
    except InputError:
        raise
    except ValueError:
        raise InputError(
            f"the parameter {text!r} must have the form PATH or PATH=LOW:HIGH, such as "
            "likelihood.sharpness=1:500."
        ) from None


def names(tracker: TrackerLike) -> list[str]:
    """Paths of all tunable parameters: the float leaves of the tracker."""
    return [name for name, leaf in _leaves(tracker).items() if _is_tunable(name, leaf)]


def read(tracker: TrackerLike, parameter: Parameter) -> jax.Array:
    """Read a parameter's value from the tracker; refuse values outside its bounds."""
    leaves = _leaves(tracker)
    leaf = leaves.get(parameter.name)
    if leaf is None or not _is_tunable(parameter.name, leaf):
        raise InputError(_why_not(tracker, parameter.name, leaf))
    value = jnp.asarray(leaf, float)
    shape = value.shape
    if len(parameter.index) > len(shape) or any(
        i >= n for i, n in zip(parameter.index, shape, strict=False)
    ):
        raise InputError(
            f"the parameter {parameter.path} is outside {parameter.name}, whose shape is "
            f"{list(shape)}; count from 0."
        )
    value = value[parameter.index]
    inside = np.asarray((value > parameter.low) & (value < parameter.high))
    if not inside.all():
        wrong = float(np.asarray(value)[~inside].flat[0])
        raise InputError(
            f"the parameter {parameter.path} starts at {wrong:g}, but must lie between "
            f"{parameter.low:g} and {parameter.high:g}, ends excluded; start inside, or leave "
            "it out."
        )
    return value


def replace(tracker: TrackerLike, values: Mapping[str, Any]) -> Any:
    """Replace parameter values, path -> value; values may be traced."""
    parameters = [Parameter(path) for path in values]
    leaves = _leaves(tracker)
    for parameter in parameters:
        if parameter.name not in leaves:
            raise InputError(_why_not(tracker, parameter.name, None))

    def exchange(path, leaf):
        name = _name(path)
        for parameter in parameters:
            if parameter.name == name:
                leaf = jnp.asarray(leaf, jnp.result_type(leaf, float))
                value = jnp.asarray(values[parameter.path], leaf.dtype)
                leaf = leaf.at[parameter.index].set(value) if parameter.index else value
        return leaf

    return jax.tree_util.tree_map_with_path(exchange, tracker)


def check_apart(parameters: Sequence[Parameter]) -> None:
    """Refuse no parameters, the same one twice, or an array together with one of its entries."""
    if not parameters:
        raise InputError("no parameter was named; name at least one, such as likelihood.sharpness.")
    for place, parameter in enumerate(parameters):
        for other in parameters[:place]:
            shorter = min(len(parameter.index), len(other.index))
            if parameter.name == other.name and parameter.index[:shorter] == other.index[:shorter]:
                raise InputError(
                    f"the parameters {other.path} and {parameter.path} overlap; name each value "
                    "once."
                )


def _leaves(tracker: TrackerLike) -> dict[str, Any]:
    return {_name(path): leaf for path, leaf in jax.tree_util.tree_flatten_with_path(tracker)[0]}


def _name(path: jax.tree_util.KeyPath) -> str:
    """Path joined by dots, without a leading ``parameters``."""
    names = [str(getattr(k, "name", getattr(k, "key", getattr(k, "idx", k)))) for k in path]
    return ".".join(names[1:] if names[1:2] == ["parameters"] else names)


def _is_tunable(name: str, leaf: object) -> bool:
    is_float = jnp.issubdtype(jnp.result_type(leaf), jnp.floating)
    return is_float and name.partition(".")[0] not in _NO_PARAMETERS


def _why_not(tracker: TrackerLike, name: str, leaf: object) -> str:
    choices = f"choose among {', '.join(names(tracker))}."
    if leaf is not None and name.partition(".")[0] not in _NO_PARAMETERS:
        kind = jnp.result_type(leaf)
        return f"the parameter {name} holds {kind}, which has no gradient; {choices}"
    return f"the tracker has no parameter {name} to tune; {choices}"
