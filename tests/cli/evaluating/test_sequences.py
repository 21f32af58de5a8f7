"""``jaxpf evaluate`` of several sequences, and what it says to folders that cannot be."""

import pytest
from command_line import jaxpf
from csv_rows import rows_of
from small_evaluation import COMMON
from small_sequence_folder import write_sequence

pytestmark = pytest.mark.usefixtures("started_jax")


def test_several_sequences_get_a_table_over_all(place, tmp_path, short_report):
    data, output = tmp_path / "data", tmp_path / "out"
    data.mkdir()
    for name in ("one", "two"):
        write_sequence(data / name)
    (data / "unreadable").mkdir()
    (data / "unreadable" / "gt.csv").write_text("")
    (data / "notes").mkdir()
    # Of sequences that have fewer frames, all.
    few = ("--frames", "1000", "--appearance", "colour")
    asked = ("evaluate", data, *COMMON, *few, "-o", output)
    outcome = jaxpf(*asked)
    assert outcome.code == 0, outcome.err
    assert "unreadable is left out: " in outcome.err
    assert "notes" not in outcome.err
    assert "one (1 of 2)" in outcome.out
    table = outcome.out[outcome.out.index("means over 2 sequences") :]
    assert "differences from SIR, paired by sequence" in table
    rows = rows_of(output / "sequences.csv")
    assert {row["sequence"] for row in rows} == {"one", "two"}
    # The same pictures under two names.
    values = {row["sequence"]: row["value"] for row in rows if row["measure"] == "iou"}
    assert values["one"] == values["two"]
    measures = {row["measure"] for row in rows_of(output / "overall.csv")}
    assert {"coverage_50", "coverage_95", "size_coverage_50", "size_coverage_95"} <= measures
    again = jaxpf("evaluate", "--config", output / "run.toml", "-o", output)
    assert again.code == 0, again.err
    assert again.out[again.out.index("means over 2 sequences") :] == table


@pytest.mark.parametrize(
    ("names", "options", "named"),
    [("one", (), "1 sequence"), ("one two", ("--ids", "1"), "--ids")],
)
def test_folders_that_cannot_be_are_refused(refuse, tmp_path_factory, names, options, named):
    folder = tmp_path_factory.mktemp("sequences")
    for name in names.split():
        write_sequence(folder / name)
    assert named in refuse(folder, *options)
