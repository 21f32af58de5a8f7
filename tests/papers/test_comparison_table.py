import csv

import numpy as np
import pytest

from jaxpf.media.plotting import new_figure
from jaxpf.papers.judging.claims import Claim, judge
from jaxpf.papers.judging.estimates import Measured, mean_of
from jaxpf.papers.paper import Comparison
from jaxpf.papers.study import Cell, Study, Table, tables

CLAIM = Claim("a_b", "paper", "a is b", "1", "a | b.", "table 1", 0.0, float("inf"), 0.0, 0, "runs")


@pytest.fixture
def comparison():
    figure, axes = new_figure()
    axes[0, 0].plot([0, 1])
    cells = [Cell(19, Measured(26.6, 20.2, 33.4)), Cell(None, Measured(1, 0, 2)), "text"]
    return Comparison(
        paper="someone1999",
        title="someone1999 repeated",
        tables=[
            Table("table_1", "Table 1 (%)", ["row", "a", "b", "c"], [("20", cells)], "A note.")
        ],
        claims=[judge(CLAIM, [mean_of(np.linspace(1, 3, 30))])],
        figures={"figure": figure},
        notes=["What was done."],
    )


def test_cells_show_published_and_measured_side_by_side():
    assert str(Cell(19, Measured(26.6, 20.2, 33.4))) == "19 | 27 [20, 33]"
    assert str(Cell(None, Measured(1.96, 1.5, 2.5), digits=1)) == "– | 2.0 [1.5, 2.5]"
    assert str(Cell(1.99, Measured(2.0, float("nan"), float("nan")), 2)) == "1.99 | 2.00"


def test_a_declared_table_has_the_rows_that_were_measured():
    rows = {("hits", name, ""): [0.0, 1.0] for name in "ab"}
    declared = {
        "measures": {"hits": {"kind": "percent"}, "shots": {}},
        "tables": [
            {
                "name": "one",
                "title": "{scenes}, {more}",
                "rows": "all",
                "columns": {"hits (%)": "hits", "n": "hits"},
                "how": {"n": {"kind": "count"}},
                "published": {"hits (%)": {"b": 70}},
            },
            {
                "name": "two",
                "columns": {"a": ["hits", "a"], "b - a": ["hits", "b", "a"]},
                "published": {"a": [float("nan")], "b - a": 5},
            },
            {"name": "not measured", "columns": {"a": ["shots", "a"]}},
        ],
    }
    one, two = tables(declared, Study(rows, words={"more": "more"}))
    assert (one.title, one.columns) == ("2 scenes, more", ["", "hits (%)", "n"])
    assert one.texts() == [["a", "– | 50", "2"], ["b", "70 | 50", "2"]]
    assert two.texts() == [["", "– | 50", "5 | 0"]]


def test_variants_are_compared_on_their_common_scenes():
    rows = {("m", "a", "x"): [1.0, 2.0, 9.0], ("m", "b", "x"): [3.0, 5.0]}
    (figure,) = Study(rows).figures("mean", "m", "b", "a")
    assert (figure.value, figure.units, figure.what) == (2.5, 2, "x")
    assert Study(rows).figures("mean", "m", "c", "a") == []
    assert Study(rows).figures("mean", "m", "a", "c") == []


def test_everything_is_written(comparison, tmp_path):
    names = comparison.write(tmp_path, "jaxpf reproduce someone1999")
    assert {"table_1.csv", "verdicts.csv", "figure.png", "someone1999.md"} == set(names)
    assert sorted(names) == sorted(path.name for path in tmp_path.iterdir())
    rows = list(csv.DictReader((tmp_path / "table_1.csv").read_text().splitlines()))
    assert (rows[0]["published"], rows[0]["measured"], rows[2]["text"]) == ("19", "26.6", "text")
    (verdict,) = csv.DictReader((tmp_path / "verdicts.csv").read_text().splitlines())
    value, low, high = (float(verdict.pop(name)) for name in ("value", "low", "high"))
    assert value == pytest.approx(2)
    assert 1 < low < 2 < high < 3
    expected = ["a_b", "", "0.95", "30", "supported", "", "jaxpf reproduce someone1999"]
    assert list(verdict.values())[:-1] == expected


def test_the_markdown_keeps_its_columns_where_cells_hold_bars(comparison):
    lines = comparison.markdown().splitlines()
    (row,) = [line for line in lines if line.startswith("| 20 ")]
    assert row.replace("\\|", "").count("|") == 5
    assert "| a \\| b. |" in "\n".join(lines)
    assert {"![figure](figure.png)", "A note."} <= set(lines)
