"""What a filter offers to commands and evaluations, which need not know it by name."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from jaxpf.contract.model import Model


class Variant(NamedTuple):
    """One way to run a method, in an evaluation.

    Attributes:
        label: for tables, such as "312" for an order; may be "".
        values: of the filter's options.
    """

    label: str
    values: dict[str, Any]


class Filter:
    """A family of methods.

    Attributes:
        name: key in the registry of ``jaxpf.filters``.
        methods: names of its methods; the option ``method`` chooses one.
        options: class of its options (``jaxpf.contract.options``), including ``method`` and
            ``particles``.
        varied: names of its options that ``variants`` varies, and that no grid has.
        by_default: whether an evaluation that names no methods compares them.
        opens: whether partitions may come and go while it runs, see ``Model.is_open``.
        nanoseconds: of one core per particle, partition and frame, without the likelihood.
    """

    name: str
    methods: tuple[str, ...]
    options: type
    varied: tuple[str, ...] = ("method",)
    by_default: bool = False
    opens: bool = False
    nanoseconds: float = 160.0

    def tracker(self, model: Model, options: Any) -> Any:
        """The tracker of a model."""
        raise TypeError(f"{type(self).__name__} must define tracker")

    def admits(self, method: str, parents: Sequence[int]) -> bool:
        """Whether a method can follow a part tree."""
        return True

    def check(self, options: Any, parents: Sequence[int]) -> None:
        """Refuse options that do not fit a part tree, before anything is compiled."""

    def check_first(self, summary: Any, ids: Sequence[Any]) -> None:
        """Refuse a start that the first frame's summary shows to be hopeless.

        ``ids`` are the partitions' names.
        """

    def variants(
        self, method: str, parents: Sequence[int], asked: Mapping[str, Sequence[Any]]
    ) -> list[Variant]:
        """The ways in which an evaluation runs a method on a part tree.

        ``asked`` holds the values requested for each of ``varied``.
        """
        return [Variant("", {"method": method})]
