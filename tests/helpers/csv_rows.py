"""Tables that were written, as a test reads them."""

import csv


def rows_of(path):
    """A dict of texts for every row."""
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
