"""Many variants of a filter on the same frames, with common random numbers, as one tracker."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract.interface import Tracker
from jaxpf.contract.pytree import pytree_dataclass


@pytree_dataclass
class Grid(contract.Tracker):
    """Trackers of one shape that share every frame's key and observation.

    Rows run one after another, because skipping a branch saves time only if all runs in a batch
    skip it; such as orderings.  Columns are vectorised.  States and summaries have leading axes
    ``[rows, columns]``.

    Attributes:
        build: ``jax.tree_util.Partial`` of a row and a column -> the tracker; all observe alike.
        rows: pytree with leading axis ``[rows]``.
        columns: pytree with leading axis ``[columns]``.
    """

    build: Callable[..., Tracker]
    rows: Any
    columns: Any

    def init(self, key: jax.Array) -> Any:
        """The states of all trackers, from one key."""
        return self._each(lambda tracker, _: tracker.init(key), None)

    def observe(self, frame: Any) -> Any:
        """The observation of any of them."""
        row, column = jax.tree.map(lambda x: x[0], (self.rows, self.columns))
        return self.build(row, column).observe(frame)

    def step_observed(self, key: jax.Array, state: Any, observation: Any) -> tuple[Any, Any]:
        """Step all trackers with one key."""

        def step(tracker: Tracker, state: Any) -> Any:
            return tracker.step_observed(key, state, observation)

        return self._each(step, state)

    def _each(self, function: Callable, states: Any) -> Any:
        def of_row(item: Any) -> Any:
            row, states = item

            def of_column(column: Any, state: Any) -> Any:
                return function(self.build(row, column), state)

            return jax.vmap(of_column)(self.columns, states)

        return lax.map(of_row, (self.rows, states))


def stacked(trees: Any) -> Any:
    """Pytrees of one shape as one with a leading axis."""
    return jax.tree.map(lambda *rows: np.stack(rows), *trees)
