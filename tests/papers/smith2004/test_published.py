"""The published figures of smith2004, transcribed a second time."""

import re

import numpy as np

from jaxpf.papers.smith2004 import PAPER

PUBLISHED = {each["name"]: each["published"] for each in PAPER.declared["tables"]}
TABLE_1 = {name: PUBLISHED[f"table_1_{name}"] for name in ("success", "precision", "recall")}
TABLE_2 = {name: PUBLISHED[f"table_2_{name}"] for name in ("recovery", "precision", "recall")}

# A second transcription, in the order in which one reads the paper's rows.
ROWS_1 = """97,69/69 100,90/87 100,91/86
            97,69/68 100,91/87 100,90/86
            93,68/68 100,91/88 100,90/87
            96,67/66 100,91/88 100,90/87"""
ROWS_2 = """2|19|10|42 27/28|27/26|17/16|41/36
            2|18|8|34  21/21|24/24|16/16|36/36
            0|21|16|38 23/22|30/29|18/17|21/22
            2|21|12|36 24/23|28/28|25/24|23/23"""


def numbers(text):
    return [float(number) for number in re.findall(r"\d+", text)]


def test_table_1_is_the_papers():
    for row, line in enumerate(ROWS_1.splitlines()):
        assert numbers(line) == [
            TABLE_1[measure][method][row]
            for method in ("Non-PS", "PS", "DPS")
            for measure in ("success", "precision", "recall")
        ]


def test_table_2_is_the_papers():
    methods = ("Non-PS", "PS mean", "PS worst", "DPS")
    for row, line in enumerate(ROWS_2.splitlines()):
        assert numbers(line) == [TABLE_2["recovery"][method][row] for method in methods] + [
            TABLE_2[measure][method][row]
            for method in methods
            for measure in ("precision", "recall")
        ]


def test_the_papers_gains_follow_from_its_tables():
    """Section 3.2: 22 points of precision (20 to 40) and 19.75 of recall (20 to 50)."""
    gain = {
        measure: np.subtract(TABLE_1[measure]["PS"], TABLE_1[measure]["Non-PS"])
        for measure in ("precision", "recall")
    }
    assert gain["precision"][:3].mean() == 22
    assert gain["recall"].mean() == 19.75


def test_the_table_of_conditions_quotes_table_2():
    ps, dps, best, worst = (
        TABLE_2["recovery"][name] for name in ("PS mean", "DPS", "PS best", "PS worst")
    )
    published = PUBLISHED["conditions"]
    assert published["PS"] == np.mean(ps)
    assert published["DPS - PS"] == np.mean(dps) - np.mean(ps)
    assert published["best - worst order"] == best[1] - worst[1]
