"""The filters of commands and evaluations: functions of a model and of annotated options.

A filter of your own joins them by ``register``, or by an entry point of the group
``jaxpf.filters``, ``NAME = "module:FILTER"``.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import entry_points
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from jaxpf.contract.calls import optional
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.model import Model
from jaxpf.contract.options import Option, options_of
from jaxpf.dynamics.gaussian import AR2
from jaxpf.filters import options as of
from jaxpf.filters.factored.eskil import Eskil
from jaxpf.filters.factored.pffl import PFFL
from jaxpf.filters.labelled.tracker import Labelled
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.ordering import Ordering, branched, named

#: Orders of ps by name: as the objects are listed (a part tree level by level), and every circular
#: shift of that order.
ORDERS = GIVEN, SHIFTS = ("given", "shifts")


class Variant(NamedTuple):
    """One variant of a method in an evaluation.

    Attributes:
        label: label in tables, such as "312" for an order; may be "".
        values: values of the filter's options.
    """

    label: str
    values: dict[str, Any]


def _one_variant(
    method: str, parents: Sequence[int], asked: Mapping[str, Sequence[Any]]
) -> list[Variant]:
    return [Variant("", {"method": method})]


def _fits(values: Mapping[str, Any], parents: Sequence[int]) -> None:
    """Refuse nothing."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Filter:
    """A filter with one or several methods.

    Attributes:
        name: of the filter.
        build: function of a ``Model`` and annotated options (``jaxpf.contract.Option``) that
            returns a tracker; its option ``method`` has the filter's methods as choices.
        divided: methods that divide the particles among the objects.
        trees: methods for which objects may be parts of a tree.
        varied: options that ``variants`` varies and that are therefore not in an evaluation's grid.
        by_default: whether evaluations include its methods by default.
        opens: whether it supports open populations, see ``Model.is_open``.
        check: function of values of its options and a part tree that refuses what does not fit.
        variants: function of a method, a part tree and the values requested for each option of
            ``varied`` that returns the variants that an evaluation runs.
    """

    name: str
    build: Callable[..., Any]
    divided: tuple[str, ...] = ()
    trees: tuple[str, ...] = ()
    varied: tuple[str, ...] = ("method",)
    by_default: bool = False
    opens: bool = False
    check: Callable[[Mapping[str, Any], Sequence[int]], None] = _fits
    variants: Callable[..., list[Variant]] = _one_variant

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of its methods."""
        return options_of(self.build)["method"].choices

    def admits(self, method: str, parents: Sequence[int]) -> bool:
        """Whether a method supports a part tree."""
        return method in self.trees or all(parent < 0 for parent in parents)

    def check_model(self, values: Mapping[str, Any], parents: Sequence[int]) -> None:
        """Refuse values that do not fit a part tree, before anything is learned."""
        method, count = values["method"], len(parents)
        if method in self.divided and values["num_particles"] < count:
            raise InputError(
                Argument("num_particles", values["num_particles"]),
                f" is fewer than the {count} objects that share them; give at least one each, "
                "better some fifty.",
            )
        if not self.admits(method, parents):
            raise InputError(
                f"method {method!r} tracks independent objects, and these are parts of a "
                "tree; choose sir, ps or sps."
            )
        self.check(values, parents)


def _partitioned(
    model: Model,
    *,
    method: Annotated[
        Literal["sir", "ps", "dps", "sps"],
        Option(
            "sir (bootstrap filter, all objects at once), ps (one after another), dps (ps in as "
            "many orders as there are objects; not for part trees), sps (side by side, then "
            "exchanged between particles)."
        ),
    ] = "dps",
    ordering: Ordering | None = None,
    order: of.Order = None,
    swap: of.Swap = "combinatorial",
    num_particles: of.NumParticles = 300,
    resampling: of.Resampling = "systematic",
    ess_threshold: of.EssThreshold = None,
    joint_weighting: of.JointWeighting = False,
) -> Partitioned:
    orders = optional(model.likelihood, "orders_of_labels")
    if ordering is None and method == "ps" and order is None and orders is not None:
        ordering = branched(orders)
    return Partitioned(
        dynamics=model.dynamics,
        likelihood=model.likelihood,
        ordering=ordering or named(method, model.parents, order=order, swap=swap),
        initial=model.initial,
        initial_label=model.initial_label,
        parents=model.parents,
        num_particles=num_particles,
        resampling=resampling,
        ess_threshold=ess_threshold,
        joint_weighting=joint_weighting,
    )


def _check_order(values: Mapping[str, Any], parents: Sequence[int]) -> None:
    """An order must name every object, parents first."""
    order, count = values["order"], len(parents)
    if order is None:
        return
    shown = ",".join(str(place + 1) for place in order)
    if sorted(order) != list(range(count)):
        raise InputError(
            f"the order {shown} is not a permutation of the {count} object(s); list each of 1 "
            f"to {count} once."
        )
    for part, parent in enumerate(parents):
        if parent >= 0 and order.index(part) < order.index(parent):
            raise InputError(
                f"the order {shown} puts part {part + 1} before its parent {parent + 1}; list "
                "every parent first."
            )


def _orders_and_swaps(
    method: str, parents: Sequence[int], asked: Mapping[str, Sequence[Any]]
) -> list[Variant]:
    """PS with each requested order, SPS with each requested swap."""
    if method == "ps":
        orders: list[tuple[int, ...]] = []
        for order in asked["order"]:
            named_order = _shifts(parents)[: 1 if order == GIVEN else None]
            orders += named_order if order in ORDERS else [tuple(order)]
        each = dict.fromkeys(orders)
        return [Variant(order_label(o), {"method": method, "order": o}) for o in each]
    if method == "sps":
        return [Variant(swap, {"method": method, "swap": swap}) for swap in asked["swap"]]
    return [Variant(SHIFTS if method == "dps" else "", {"method": method})]


def order_label(order: Sequence[int]) -> str:
    """Format an order from 1: (2, 0, 1) is "312", with hyphens for ten or more objects."""
    return ("" if len(order) < 10 else "-").join(str(place + 1) for place in order)


def _shifts(parents: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the circular shifts; on a part tree, only the level-by-level order."""
    if any(parent >= 0 for parent in parents):
        return [tuple(named("ps", parents).order[0].tolist())]
    base = tuple(range(len(parents)))
    return [base[shift:] + base[:shift] for shift in range(len(base))]


def _eskil(
    model: Model,
    *,
    method: Annotated[
        Literal["eskil"],
        Option(
            "eskil (every object has its own particles; objects drift together and keep a shape; "
            "biased)."
        ),
    ] = "eskil",
    num_particles: of.NumParticles = 10,
    resampling: of.Resampling = "systematic",
    upsampling: of.Upsampling = 3,
    drift: of.Drift = "clip",
    shape: of.Shape = "relative",
    shape_scale: of.ShapeScale = 0.1,
    velocity_memory: of.VelocityMemory = 10,
    proper: of.Proper = False,
) -> Eskil:
    dynamics = model.dynamics
    if drift != "none" and type(dynamics) is AR2:
        # Drift and momentum would count the same motion twice, and points would run away.
        dynamics = dataclasses.replace(dynamics, momentum=np.float32(0))
    return Eskil(
        dynamics=dynamics,
        likelihood=model.likelihood,
        initial=model.initial,
        num_particles=num_particles,
        resampling=resampling,
        upsampling=upsampling,
        drift=drift,
        shape=shape,
        shape_scale=shape_scale,
        memory=velocity_memory,
        proper=proper,
    )


def _pffl(
    model: Model,
    *,
    method: Annotated[
        Literal["pffl"],
        Option("pffl (eskil without drift and shape, and without its authors' learned prior)."),
    ] = "pffl",
    num_particles: of.NumParticles = 50,
    resampling: of.Resampling = "systematic",
    upsampling: of.Upsampling = 1,
    form: of.Form = "auxiliary",
) -> PFFL:
    return PFFL(
        dynamics=model.dynamics,
        likelihood=model.likelihood,
        initial=model.initial,
        num_particles=num_particles,
        resampling=resampling,
        upsampling=upsampling,
        form=form,
    )


def _labelled(
    model: Model,
    *,
    method: Annotated[
        Literal["labelled"], Option("labelled (each particle holds one object).")
    ] = "labelled",
    num_particles: of.NumParticles = 300,
    resampling: of.Resampling = "systematic",
    weights: of.Weights = "equal_share",
    feedback: of.Feedback = "none",
    regularise: of.Regularise = None,
) -> Labelled:
    return Labelled(
        dynamics=model.dynamics,
        likelihood=model.likelihood,
        initial=model.initial,
        num_particles=num_particles,
        resampling=resampling,
        weights=weights,
        feedback=feedback,
        population="open" if model.is_open else "fixed",
        regularise=None if regularise is None else np.asarray(regularise, np.float32),
    )


#: The filters of this library, in the order of tables and help.
_OWN = (
    Filter(
        name="partitioned",
        build=_partitioned,
        divided=("dps",),
        trees=("sir", "ps", "sps"),  # circular shifts put parts before their parents
        varied=("method", "order", "swap"),
        by_default=True,
        check=_check_order,
        variants=_orders_and_swaps,
    ),
    Filter(name="eskil", build=_eskil),
    Filter(name="pffl", build=_pffl),
    Filter(
        name="labelled",
        build=_labelled,
        divided=("labelled",),
        opens=True,
    ),
)
_REGISTERED: dict[str, Filter] = {}


def register(filter_: Filter) -> None:
    """Add a filter to the command line and to evaluations."""
    _REGISTERED[filter_.name] = filter_


@functools.cache
def _installed() -> dict[str, Filter]:
    return {entry.name: entry.load() for entry in entry_points(group="jaxpf.filters")}


def all_filters() -> dict[str, Filter]:
    """All filters, by name."""
    return {each.name: each for each in _OWN} | _installed() | _REGISTERED


def methods() -> tuple[str, ...]:
    """Names of the methods of all filters."""
    return tuple(method for filter_ in all_filters().values() for method in filter_.methods)


def filter_of(method: str) -> Filter:
    """Return the filter that a method belongs to."""
    for filter_ in all_filters().values():
        if method in filter_.methods:
            return filter_
    raise InputError(f"method {method!r} is unknown; choose one of {', '.join(methods())}.")


def build(model: Model, *, method: str | None = None, **options: Any) -> Any:
    """The tracker of a model by the filter of a method.

    Args:
        model: dynamics, likelihood and initial state.
        method: see ``methods``; default dps.
        options: of its filter, None for a default; ``resampling`` may be a scheme of your own, and
            ``ordering`` one from ``jaxpf.ordering`` in the place of the method's.
    """
    given = {name: value for name, value in options.items() if value is not None}
    return filter_of(method or "dps").build(model, method=method or "dps", **given)
