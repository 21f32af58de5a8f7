"""SIR, PS, DPS and SPS as a filter family, and the ordering of each method."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.model import Model
from jaxpf.contract.names import GIVEN, METHODS, ORDERS, SHIFTS
from jaxpf.contract.optional import optional
from jaxpf.filters.filter import Filter, Variant
from jaxpf.filters.partitioned.options import Options

if TYPE_CHECKING:
    from jaxpf.filters.partitioned.tracker import Partitioned


class _PartitionedFilter(Filter):
    """The partitioned filters: SIR, PS, DPS and SPS."""

    name = "partitioned"
    methods = METHODS
    options = Options
    varied = ("method", "order", "swap")
    by_default = True

    def tracker(self, model: Model, options: Options) -> "Partitioned":
        from jaxpf.filters.partitioned.tracker import Partitioned
        from jaxpf.ordering import branched, named

        self.check(vars(options), model.parents)
        orders = optional(model.likelihood, "orders_of_labels")
        if options.method == "ps" and options.order is None and orders is not None:
            ordering = branched(orders)
        else:
            ordering = named(options.method, model.parents, order=options.order, swap=options.swap)
        return Partitioned(
            dynamics=model.dynamics,
            likelihood=model.likelihood,
            ordering=ordering,
            initial=model.initial,
            initial_label=model.initial_label,
            parents=model.parents,
            num_particles=options.num_particles,
            resampling=options.resampling,
            ess_threshold=options.ess_threshold,
            joint_weighting=options.joint_weighting,
        )

    def admits(self, method: str, parents: Sequence[int]) -> bool:
        """No DPS on part trees, as circular shifts put parts before parents."""
        return method != "dps" or all(parent < 0 for parent in parents)

    def check(self, values: Mapping[str, Any], parents: Sequence[int]) -> None:
        """DPS needs enough particles, and an order must name every object."""
        count, order = len(parents), values["order"]
        if values["method"] == "dps" and values["num_particles"] < count:
            raise InputError(
                Argument("num_particles", values["num_particles"]),
                f" is fewer than the {count} components of dps, one per object; give at least "
                f"{count}, better some hundreds.",
            )
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

    def variants(
        self, method: str, parents: Sequence[int], asked: Mapping[str, Sequence[Any]]
    ) -> list[Variant]:
        """PS with each requested order, SPS with each requested swap."""
        if method == "ps":
            orders = _orders(asked["order"], parents)
            return [Variant(order_label(o), {"method": method, "order": o}) for o in orders]
        if method == "sps":
            return [Variant(swap, {"method": method, "swap": swap}) for swap in asked["swap"]]
        return [Variant(SHIFTS if method == "dps" else "", {"method": method})]


PARTITIONED = _PartitionedFilter()


def order_label(order: Sequence[int]) -> str:
    """Format an order from 1: (2, 0, 1) is "312", with hyphens for ten or more objects."""
    return ("" if len(order) < 10 else "-").join(str(place + 1) for place in order)


def _orders(asked: Sequence[Any], parents: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the distinct orders that an evaluation requests."""
    orders: list[tuple[int, ...]] = []
    for order in asked:
        if order in ORDERS:
            orders += _shifts(parents)[: 1 if order == GIVEN else None]
        else:
            orders.append(tuple(order))
    return list(dict.fromkeys(orders))


def _shifts(parents: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the circular shifts; on a part tree, only the level-by-level order."""
    if any(parent >= 0 for parent in parents):
        from jaxpf.ordering import named

        return [tuple(named("ps", parents).order[0].tolist())]
    base = tuple(range(len(parents)))
    return [base[shift:] + base[:shift] for shift in range(len(base))]
