"""Two objects in two frames, and three runs whose measures are known by hand."""

import math

import numpy as np
from csv_rows import rows_of

NAN = [math.nan] * 4
TRUE = [0.0, 0.0, 10.0, 10.0]
HALF = [5.0, 0.0, 10.0, 10.0]  # E = G = 100, common 50, union 150, centre 5 away
FAR = [50.0, 0.0, 10.0, 10.0]
# Two frames; the second object is absent in the first of them.
TRUTH = np.array([[TRUE, NAN], [TRUE, TRUE]])
BOXES = np.array(
    [
        [[TRUE, TRUE], [HALF, TRUE]],
        [[FAR, TRUE], [TRUE, FAR]],
        [[TRUE, TRUE], [FAR, NAN]],
    ]
)


def numbers(rows, name):
    return [float(row[name]) if row[name] else math.nan for row in rows]


def found(folder, measure, identity, method="SIR", file="summary.csv"):
    """The one row of the summary about a measure of an object, as floats where it can."""
    rows = [
        row
        for row in rows_of(folder / file)
        if (row["measure"], row["object"], row["method"]) == (measure, f"{identity}", method)
    ]
    assert len(rows) == 1, (measure, identity, method)
    return {name: _float(value) for name, value in rows[0].items()}


def _float(text):
    try:
        return float(text)
    except ValueError:
        return math.nan if text == "" else text
