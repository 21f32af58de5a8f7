"""``jaxpf evaluate`` of several sequences, and what it says to lists that cannot be."""

import csv

import pytest
from command_line import jaxpf
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
    asked = ("evaluate", data, *COMMON, "--frames", "1000", "-o", output)
    outcome = jaxpf(*asked)
    assert outcome.code == 0, outcome.err
    assert "unreadable is left out: " in outcome.err
    assert "notes" not in outcome.err
    assert "one (1 of 2)" in outcome.out
    table = outcome.out[outcome.out.index("means over 2 sequences") :]
    assert "differences from SIR, paired by sequence" in table
    with open(output / "sequences.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["sequence"] for row in rows} == {"one", "two"}
    # The same pictures under two names.
    values = {row["sequence"]: row["value"] for row in rows if row["measure"] == "overlap"}
    assert values["one"] == values["two"]
    measures = {row["measure"] for row in csv.DictReader((output / "overall.csv").open(newline=""))}
    assert {"coverage_50", "coverage_95", "size_coverage_50", "size_coverage_95"} <= measures
    again = jaxpf("evaluate", "--config", output / "run.toml", "-o", output)
    assert again.code == 0, again.err
    assert again.out[again.out.index("means over 2 sequences") :] == table


def test_a_file_lists_scenes_with_their_seeds(place, tmp_path):
    listed = tmp_path / "list.txt"
    listed.write_text(f"# two of one kind\ndistracter 3\n{place / 'two'}\n\ndistracter 4\n")
    outcome = jaxpf("evaluate", listed, "--methods", "sir", "--dry-run", "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    for words in ("distracter-3 (1 of 3)", "two (2 of 3)", "distracter-4 (3 of 3)"):
        assert words in outcome.out
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "options", "sentence"),
    [
        ("# none", (), "list.txt' lists no scene; give a scene in each line"),
        ("\0\udcff", (), "list.txt' is not a text file"),
        ("distracter x", (), "reads 'distracter x'; write a scene, and a seed after it"),
        ("distracter 1", (), "holds 1 sequence(s) that can be evaluated together"),
        ("distracter 1\ndistracter 1", (), "two sequences are called 'distracter-1'"),
        ("distracter 1\ndistracter 2", ("--ids", "1"), "--ids works only for a single sequence"),
    ],
)
def test_lists_that_cannot_be_are_one_sentence(refuse, tmp_path_factory, text, options, sentence):
    listed = tmp_path_factory.mktemp("listed") / "list.txt"
    listed.write_bytes(text.encode(errors="surrogateescape"))
    assert sentence in refuse(listed, *options)
