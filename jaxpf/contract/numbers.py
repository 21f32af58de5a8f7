"""Numbers that a user gives.  Imports no JAX, which help texts must not load."""

from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError


def numbers_in(name: str, value: Any, wanted: str) -> np.ndarray:
    """Convert the concrete ``value`` of the argument ``name`` to float64.

    Raises:
        InputError: it does not hold real numbers; the message says what is ``wanted``.
    """
    try:
        numbers = np.asarray(value)
        if numbers.dtype.kind in "biuf" or "float" in numbers.dtype.name:
            return numbers.astype(float)
    except (TypeError, ValueError):
        pass  # such as rows of different lengths
    raise InputError(f"{name}={value!r:.60} must be {wanted}.")
