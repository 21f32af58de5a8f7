"""What ``jaxpf track`` tells of how sure it is: uncertainty.csv, means of it, where to draw it."""

import contextlib
from collections.abc import Sequence
from typing import Any

import click
import numpy as np

#: So many particles and objects are sorted in every frame, at most: some 20 ms.
_SORTED = 200_000


class UncertaintyTable:
    """Writes uncertainty.csv, see ``uncertainty_table``; it closes as a context does."""

    def __init__(self, output: Any, request: Any, tracker: Any):
        self._path, self._run = output / "uncertainty.csv", request.run
        own_boxes = bool(request.run.tracker) and hasattr(tracker, "boxes")
        self._coordinates = () if own_boxes else request.target.coordinates
        self._stack = contextlib.ExitStack()
        self._writer: Any = None
        #: Of every object's place: sums over frames of its spread and its error, and their numbers.
        self._sums = self._known = np.zeros((2, 0))

    def __enter__(self) -> "UncertaintyTable":
        return self

    def __exit__(self, *exception: Any) -> Any:
        return self._stack.__exit__(*exception)

    def append(
        self, number: int, tracked: Any, ids: Sequence[Any], chosen: Any = slice(None)
    ) -> None:
        """The lines of one frame.

        Args:
            number: of the frame.
            tracked: as ``stream`` gives it.
            ids: of the objects.
            chosen: which partitions they are.
        """
        from jaxpf.cli.tracking.uncertainty_table import LEVELS, UncertaintyWriter
        from jaxpf.filters import quantiles

        summary = tracked.summary
        if getattr(summary, "spread", None) is None:
            return  # a tracker of the user's own may report less
        estimate, spread = summary.estimate[chosen], summary.spread[chosen]
        if self._writer is None:
            writer = UncertaintyWriter(self._path, self._coordinates, estimate.shape[-1])
            self._writer = self._stack.enter_context(writer)
        variance = getattr(summary, "estimate_variance", None)
        error = np.full(spread.shape, np.nan) if variance is None else np.sqrt(variance)[chosen]
        cloud, found = self.cloud(tracked.state), None
        if self._has_places and _is_small(cloud):
            places = np.asarray(cloud.substates)[..., :2]
            levels = [level / 100 for level in LEVELS]
            found = quantiles(places, cloud.log_weights, levels)[:, chosen]
        self._writer.append(number, ids, estimate, spread, error, found)
        if self._has_places and isinstance(chosen, slice):
            values = np.stack([spread[:, :2], error[:, :2]]).mean(axis=-1)
            known = np.isfinite(values)
            self._sums = np.where(known, values, 0) + (self._sums if self._sums.size else 0)
            self._known = known + (self._known if self._known.size else 0)

    @property
    def _has_places(self) -> bool:
        return tuple(self._coordinates[:2]) == ("x", "y")

    def cloud(self, state: Any) -> Any:
        """What holds the particles of a tracker's state."""
        return state.state if self._run.error_bars else state

    def places(self, summary: Any) -> Any:
        """Estimates of x, y and their spreads, ``[2, P, 2]``; None where nobody knows."""
        if not self._has_places or getattr(summary, "spread", None) is None:
            return None
        return np.stack([summary.estimate[:, :2], summary.spread[:, :2]])

    def means(self, ids: Sequence[Any]) -> dict[str, Any]:
        """For the summary: ``mean_spread`` and ``mean_error`` of x and y in pixels, by object.

        None where nobody knows; errors are means over the frames in which they are known.
        """
        found: dict[str, Any] = {}
        for row, name in enumerate(("mean_spread", "mean_error")):
            found[name] = None
            if self._sums.size and self._known[row].any():
                mean = self._sums[row] / np.maximum(self._known[row], 1)
                pairs = zip(ids, mean, self._known[row], strict=True)
                found[name] = {str(i): round(float(m), 4) if k else None for i, m, k in pairs}
        return found

    def tell(self, ids: Sequence[Any]) -> None:
        """Print the errors that were asked for, beside the spreads."""
        means = self.means(ids)
        if means["mean_error"] is None:
            if self._run.error_bars and self._has_places:
                click.echo(
                    "Note: too few ancestors were left to tell how much another run would differ; "
                    "ask for fewer frames (--error-bars), more particles (-n) or --runs.",
                    err=True,
                )
            return
        known = {name: error for name, error in means["mean_error"].items() if error is not None}
        told = [
            f"{name} {error:.2g} ({means['mean_spread'][name]:.2g})"
            for name, error in known.items()
        ]
        click.echo(f"Monte-Carlo error of places in pixels (spread): {', '.join(told)}")


def _is_small(state: Any) -> bool:
    """Whether its particles are sorted in a moment."""
    substates = getattr(state, "substates", None)
    return substates is not None and substates.shape[0] * substates.shape[1] <= _SORTED
