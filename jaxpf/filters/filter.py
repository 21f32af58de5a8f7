"""What a filter says of itself, so that commands and evaluations need not know it by name."""

from collections.abc import Sequence
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
    """How guesses are organised.

    Attributes:
        name: by which the registry in ``jaxpf.filters`` knows it.
        methods: names of its methods; the option ``method`` chooses one.
        options: class of its options (``jaxpf.contract.options``), ``method`` and ``particles``
            among them.
        varied: names of its options that ``variants`` varies, and that no grid has.
        by_default: whether an evaluation that names no methods compares them.
        opens: whether partitions may come and go while it runs, see ``Model.is_open``.
        nanoseconds: of one core per particle, partition and frame, the likelihood excluded.
    """

    name: str
    methods: tuple[str, ...]
    options: type
    varied: tuple[str, ...] = ("method",)
    by_default: bool = False
    opens: bool = False
    nanoseconds: float = 160.0

    def tracker(self, model: Model, options: Any) -> Any:
        """The tracker of a model.

        Raises:
            InputError: options that do not go with each other, or with the model.
        """
        raise TypeError(f"{type(self).__name__} must define tracker")

    def admits(self, method: str, parents: Sequence[int]) -> bool:
        """Whether a method can follow a part tree."""
        return True

    def check(self, options: Any, parents: Sequence[int]) -> None:
        """Refuse options that do not go with a part tree, before anything is compiled.

        Raises:
            InputError: the sentence says which.
        """

    def check_first(self, summary: Any, ids: Sequence[Any]) -> None:
        """Refuse a start that the first frame shows to be hopeless.

        Args:
            summary: of the first frame.
            ids: what the partitions are called.

        Raises:
            InputError: the sentence says who cannot start.
        """

    def variants(
        self, method: str, parents: Sequence[int], asked: dict[str, Sequence[Any]]
    ) -> list[Variant]:
        """The ways in which an evaluation runs a method.

        Args:
            method: of ``methods``.
            parents: the part tree.
            asked: what was asked for each of ``varied``.

        Raises:
            InputError: an order that is no permutation, and the like.
        """
        return [Variant("", {"method": method})]
