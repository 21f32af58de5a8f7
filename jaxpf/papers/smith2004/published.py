"""The figures that smith2004 publishes, as data: Smith and Gatica-Perez, BMVC 2004.

All are percentages.  A table maps a measure to the methods' cells, one for each sharpness.
"""

from typing import Any

#: Lambda of the likelihood exp(-lambda d^2), the rows of tables 1 and 2.
SHARPNESS = (20.0, 30.0, 40.0, 50.0)

Column = tuple[Any, ...]

#: Table 1: objects 2 to 7.
TABLE_1: dict[str, dict[str, Column]] = {
    "success": {
        "Non-PS": (97, 97, 93, 96),
        "PS": (100, 100, 100, 100),
        "DPS": (100, 100, 100, 100),
    },
    "precision": {
        "Non-PS": (69, 69, 68, 67),
        "PS": (90, 91, 91, 91),
        "DPS": (91, 90, 90, 90),
    },
    "recall": {
        "Non-PS": (69, 68, 68, 66),
        "PS": (87, 87, 88, 88),
        "DPS": (86, 86, 87, 87),
    },
}

#: Index of the only sharpness, 30, at which section 3.3 gives the best order's recovery.
BEST_GIVEN_AT = 1

#: Table 2: object 1; precision and recall over the frames with T = 1.
TABLE_2: dict[str, dict[str, Column]] = {
    "recovery": {
        "Non-PS": (2, 2, 0, 2),
        "PS mean": (19, 18, 21, 21),
        "PS worst": (10, 8, 16, 12),
        "PS best": (None, 38, None, None),
        "DPS": (42, 34, 38, 36),
    },
    "precision": {
        "Non-PS": (27, 21, 23, 24),
        "PS mean": (27, 24, 30, 28),
        "PS worst": (17, 16, 18, 25),
        "DPS": (41, 36, 21, 23),
    },
    "recall": {
        "Non-PS": (28, 21, 22, 23),
        "PS mean": (26, 24, 29, 28),
        "PS worst": (16, 16, 17, 24),
        "DPS": (36, 36, 22, 23),
    },
}

#: Section 3.3: mean uniqueness, over all orders, of the object in the first stage of PS at
#: lambda = 20.  The paper says "1.99" where its figure shows percentages of N.
FIRST_STAGE_UNIQUENESS = 1.99
