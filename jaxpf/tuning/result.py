"""Results of tuning: values, their uncertainty, and traces."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jax.typing import ArrayLike
from scipy.special import stdtrit

from jaxpf.tuning.parameters import Parameter
from jaxpf.tuning.settings import Settings

#: Maximum number of array entries that are printed.
_SHOWN = 6


@dataclasses.dataclass(frozen=True)
class Descent:
    """One repeat, possibly unfinished.

    Attributes:
        repeat: number of the repeat, from 0.
        free: path -> ``[S + 1, ...]``, unconstrained numbers before the first step and after each.
        loss: ``[S]``, before each step.
        gradient_norm: ``[S]``, before clipping.
        moments: state of the optimiser.
        stopped: "" while running, "settled", or "all steps".
    """

    repeat: int
    free: dict[str, np.ndarray]
    loss: np.ndarray
    gradient_norm: np.ndarray
    moments: list[np.ndarray]
    stopped: str

    @property
    def num_steps(self) -> int:
        """S, number of completed steps."""
        return len(self.loss)


@dataclasses.dataclass(frozen=True)
class Result:
    """Tuned values.

    Attributes:
        parameters: the tuned parameters.
        start: path -> value before tuning.
        free: path -> unconstrained numbers of ``values``.
        spread_errors: path -> standard error of the unconstrained numbers from the spread over
            repeats (sd / sqrt(repeats)): the effect of random numbers and starting values.  NaN
            with one repeat.
        curvature_errors: path -> standard error of the unconstrained numbers from the curvature of
            the log evidence (inverse of the observed information): how well the frames determine
            them.  NaN for other objectives, and where the curvature is not that of a maximum.
        descents: traces of the repeats.
        no_curvature: why there are no ``curvature_errors``, or "".
    """

    parameters: tuple[Parameter, ...]
    start: dict[str, np.ndarray]
    free: dict[str, np.ndarray]
    spread_errors: dict[str, np.ndarray]
    curvature_errors: dict[str, np.ndarray]
    descents: list[Descent]
    no_curvature: str = ""

    def __repr__(self) -> str:
        intervals, values = self.intervals(), self.values
        lines = [f"Result of {len(self.descents)} repeats, with 95% intervals"]
        for name, value in values.items():
            numbers = [np.ravel(x)[:_SHOWN] for x in (value, *intervals[name])]
            shown = [
                f"{x:.4g} [{low:.4g}, {high:.4g}]" if low < high else f"{x:.4g}"
                for x, low, high in zip(*numbers, strict=True)
            ]
            shown += ["..."] * (np.size(value) > _SHOWN)
            lines.append(f"  {name} = {', '.join(shown)}")
        return "\n".join([*lines, *(f"  {remark}" for remark in self.remarks)])

    @property
    def settled(self) -> bool:
        """Whether the values settled in every repeat."""
        return all(descent.stopped == "settled" for descent in self.descents)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings to show wherever the values and their errors are shown; often none."""
        warnings = []
        if not self.settled:
            count = sum(descent.stopped != "settled" for descent in self.descents)
            warnings.append(
                f"{count} of {len(self.descents)} repeats stopped before they settled: the errors "
                "leave out how far the values would still have moved. Ask for more steps, or "
                "start nearer."
            )
        if self.no_curvature:
            warnings.append(f"Errors of the frames are left out: {self.no_curvature}.")
        return tuple(warnings)

    @property
    def values(self) -> dict[str, np.ndarray]:
        """path -> tuned value, from the last window's mean over all repeats."""
        return self._values(self.free)

    @property
    def last_good(self) -> dict[str, np.ndarray]:
        """path -> value of the last step with a finite loss."""
        return self._values({name: z[-1] for name, z in self.descents[-1].free.items()})

    def _values(self, free: Mapping[str, ArrayLike]) -> dict[str, np.ndarray]:
        return {
            parameter.path: np.asarray(parameter.to_value(free[parameter.path]))
            for parameter in self.parameters
        }

    def total_errors(self) -> dict[str, np.ndarray]:
        """path -> standard error of the unconstrained numbers, both sources; NaN if unknown."""

        def total(name: str) -> np.ndarray:
            both = np.stack([self.spread_errors[name], self.curvature_errors[name]])
            return np.where(np.isnan(both).all(axis=0), np.nan, np.sqrt(np.nansum(both**2, axis=0)))

        return {name: total(name) for name in self.free}

    def standard_errors(self) -> dict[str, np.ndarray]:
        """path -> standard error of the value; valid for settled values only, see ``remarks``."""
        total = self.total_errors()
        return {
            parameter.path: np.abs(np.asarray(parameter.slope(self.free[parameter.path])))
            * total[parameter.path]
            for parameter in self.parameters
        }

    def intervals(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """path -> ends of Student's 95% interval, always within the bounds.

        NaN below two degrees of freedom: two repeats alone do not tell how much they vary.
        """
        ends: tuple[dict[str, np.ndarray], ...] = ({}, {})
        repeats = len(self.descents)
        for name, total in self.total_errors().items():
            # Welch and Satterthwaite: of the two errors only the spread is estimated from repeats.
            share = np.nan_to_num(self.spread_errors[name]) / np.where(total > 0, total, 1)
            freedom = np.maximum(repeats - 1, 1) / np.maximum(share, 1e-3) ** 4
            reach = np.where(freedom >= 2, stdtrit(freedom, 0.975) * total, np.nan)
            for end, side in zip(ends, (-1, 1), strict=True):
                end[name] = self.free[name] + side * reach
        low, high = map(self._values, ends)
        return {name: (low[name], high[name]) for name in self.free}


def summarise(
    parameters: Sequence[Parameter],
    start: Mapping[str, ArrayLike],
    descents: list[Descent],
    settings: Settings,
) -> Result:
    """Combine repeats: the mean over repeats of each repeat's mean over its last window."""
    free, errors = {}, {}
    windows = [min(settings.window, max(1, descent.num_steps // 2)) for descent in descents]
    for path in (parameter.path for parameter in parameters):
        tails = np.stack(
            [
                d.free[path][-window:].mean(axis=0)
                for d, window in zip(descents, windows, strict=True)
            ]
        )
        free[path], errors[path] = tails.mean(axis=0), np.full(tails.shape[1:], np.nan)
        if len(tails) > 1:
            errors[path] = tails.std(axis=0, ddof=1) / np.sqrt(len(tails))
    return Result(
        parameters=tuple(parameters),
        start={name: np.asarray(value) for name, value in start.items()},
        free=free,
        spread_errors=errors,
        curvature_errors={name: np.full(np.shape(z), np.nan) for name, z in free.items()},
        descents=descents,
    )
