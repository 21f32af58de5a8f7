"""Ranges of numbers that options and the functions that take them share.  Imports no JAX."""

from jaxpf.contract.numbers import check_number, check_whole

#: Argument -> bounds, as ``option``, ``check_number`` and ``check_whole`` take them.
RANGES: dict[str, dict[str, int]] = {
    "sharpness": {"above": 0},
    "sigma": {"above": 0},
    "slip": {"least": 0},
    "flip": {"least": 0, "most": 1},
    # Of contours and their edges.
    "width": {"above": 0},
    "num_lines": {"least": 4, "most": 1000},
    "length": {"least": 3, "most": 253},  # a place on a line is stored in 8 bits
    "threshold": {"least": 0},
    "smoothing": {"least": 0, "most": 20},
    "independence": {"above": 0, "most": 1},
    "clutter": {"above": 0},
}


def check_ranges(**values: object) -> None:
    """Refuse arguments outside their ``RANGES``; traced values pass."""
    for name, value in values.items():
        check = check_whole if name in ("num_lines", "length") else check_number
        check(name, value, **RANGES[name])
