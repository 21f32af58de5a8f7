"""How sure tracks are, as a table: how wide the particles lie, and how much another run differs."""

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.files.writing import LineWriter

#: Of the particles' x and y, in percent: the middle, and the ends of a 95 % interval.
LEVELS = (2.5, 50, 97.5)
_PLACE = ("x", "y")


class UncertaintyWriter(LineWriter):
    """CSV with a line for every frame (counting from 0) and object.

    Columns, for every coordinate c of a substate (centres in pixels, angles in radians): ``c``, the
    estimate; ``spread_c``, the posterior's standard deviation; ``error_c``, the Monte-Carlo
    standard error of the estimate, empty where nobody asked or nobody knows.  Of a place also
    ``x_2.5``, ``x_50``, ``x_97.5`` and those of y: what share of the particles, in percent, lies
    below; empty where there are too many particles to sort.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        coordinates: Sequence[str],
        dimension: int,
        quantiles: bool = True,
    ):
        """Create the file.

        Args:
            path: the file.
            coordinates: names of the first ones; others are numbered.
            dimension: D.
            quantiles: whether there are columns of them.

        Raises:
            InputError: it cannot be written.
        """
        names = [*coordinates[:dimension]]
        names += [f"c{number}" for number in range(len(names) + 1, dimension + 1)]
        self._places = 2 if quantiles and tuple(names[:2]) == _PLACE else 0
        columns = ["frame", "id", *names]
        columns += [f"{what}_{name}" for what in ("spread", "error") for name in names]
        columns += [f"{name}_{level:g}" for name in names[: self._places] for level in LEVELS]
        self.header = ",".join(columns)
        super().__init__(path)

    def append(
        self,
        frame: int,
        ids: Sequence[object],
        estimate: ArrayLike,
        spread: ArrayLike,
        error: ArrayLike | None = None,
        quantiles: ArrayLike | None = None,
    ) -> None:
        """Write one frame.

        Args:
            frame: counting from 0.
            ids: ``[P]``.
            estimate: ``[P, D]``.
            spread: ``[P, D]``.
            error: ``[P, D]``; NaN, or None, where it is not known.
            quantiles: of x and y at ``LEVELS``, ``[3, P, 2]``.

        Raises:
            InputError: the disk is full or the file cannot be written.
        """
        estimate = np.asarray(estimate, float)
        unknown = np.full(estimate.shape, np.nan)
        error = unknown if error is None else np.asarray(error, float)
        if quantiles is None:
            quantiles = np.full((len(LEVELS), len(estimate), 2), np.nan)
        by_place = np.moveaxis(np.asarray(quantiles, float)[..., : self._places], 0, -1)
        shape = len(estimate), self._places * len(LEVELS)
        numbers = np.concatenate(
            [estimate, np.asarray(spread, float), error, by_place.reshape(shape)],
            axis=1,
        )
        self.write_rows(
            [frame, name, *("" if np.isnan(one) else f"{one:.6g}" for one in row)]
            for name, row in zip(ids, numbers, strict=True)
        )
