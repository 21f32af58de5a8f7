"""Interface of a filter family for commands and evaluations."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model

if TYPE_CHECKING:
    from jaxpf.contract.types import TrackerLike


class FilterOptions(TypedDict, total=False):
    """Options of this library's filters, for the signatures of factories; see their classes."""

    order: Sequence[int] | None
    swap: str
    resampling: Any
    ess_threshold: float | None
    joint_weighting: bool
    upsampling: int | None
    drift: str
    shape: str
    shape_scale: float
    velocity_memory: int
    proper: bool
    form: str
    weights: str
    feedback: str
    regularise: Sequence[float] | None


class Variant(NamedTuple):
    """One variant of a method in an evaluation.

    Attributes:
        label: label in tables, such as "312" for an order; may be "".
        values: values of the filter's options.
    """

    label: str
    values: dict[str, Any]


class Filter:
    """A family of methods.

    Attributes:
        name: key in the registry of ``jaxpf.filters``.
        methods: names of its methods; the option ``method`` chooses one.
        options: class of its options (``jaxpf.contract.options``), including ``method`` and
            ``num_particles``.
        varied: options that ``variants`` varies and that are therefore not in an evaluation's grid.
        by_default: whether evaluations include its methods by default.
        opens: whether it supports open populations, see ``Model.is_open``.
        takes_trees: whether objects may be parts of a tree.
    """

    name: str
    methods: tuple[str, ...]
    options: type
    varied: tuple[str, ...] = ("method",)
    by_default: bool = False
    opens: bool = False
    takes_trees: bool = True

    def tracker(self, model: Model, options: Any) -> "TrackerLike":
        """Build the tracker for a model."""
        raise TypeError(f"{type(self).__name__} must define tracker")

    def admits(self, method: str, parents: Sequence[int]) -> bool:
        """Whether a method supports a part tree."""
        return self.takes_trees or all(parent < 0 for parent in parents)

    def check(self, values: Mapping[str, Any], parents: Sequence[int]) -> None:
        """Refuse values of its options that do not fit a part tree, before compilation."""
        if not (self.takes_trees or self.admits(values["method"], parents)):
            raise InputError(
                f"method {values['method']!r} tracks independent objects, and these are parts of a "
                "tree; choose sir, ps or sps."
            )

    def variants(
        self, method: str, parents: Sequence[int], asked: Mapping[str, Sequence[Any]]
    ) -> list[Variant]:
        """Return the variants of a method that an evaluation runs on a part tree.

        ``asked`` holds the values requested for each option in ``varied``.
        """
        return [Variant("", {"method": method})]
