"""What the command line prints says what it means."""

import re
from pathlib import Path

import numpy as np
import pytest
from command_line import jaxpf

from jaxpf import media
from jaxpf.cli.shared import console


@pytest.mark.parametrize(
    ("columns", "label", "explained"),
    [
        (
            ["recovery, object 1", "success (%)", "distinct", "IoU"],
            "DPS",
            ["recovery", "success", "distinct", "IoU", "tracked"],
        ),
        (["precision", "IDSW"], "tracked", ["precision", "IDSW", "tracked"]),
        (["before"], "success", ["success", "tracked"]),
        (["success at IoU 0.5"], "DPS", ["success at IoU 0.5"]),
        (["smith2004 success"], "DPS", ["smith2004 success", "tracked"]),
        (["before"], "momentum", []),
    ],
)
def test_a_table_explains_the_terms_that_it_uses(capsys, columns, label, explained):
    console.print_table("A", ["", *columns], [[label, *["1"] * len(columns)]])
    *_, line = capsys.readouterr().out.strip().splitlines()
    assert re.findall(r"(?:^|; )([^:;]+): \w", line) == explained


def test_a_percent_sign_stands_at_its_number():
    """In what is printed, in help, reports, pages and notebooks."""
    root = Path(__file__).resolve().parents[2]
    printing = [root / "jaxpf" / room for room in ("cli", "evaluation", "papers", "tuning")]
    texts = [
        path
        for folder in (*printing, root / "notebooks")
        for path in folder.rglob("*")
        if path.suffix in {".py", ".html", ".csv", ".md", ".ipynb"}
        and "generated" not in path.parts
    ]
    apart = [
        f"{path.relative_to(root)}: {line}"
        for path in texts
        for line in path.read_text().splitlines()
        if re.search(r"[\d}] %(?!})", line)
    ]
    assert not apart


def test_names_in_a_table_and_in_the_progress_bar_are_no_markup(capsys):
    console.print_table("[/bold]", ["", "x"], [["[/red]:smile:", "1"]])
    with console.progress_bar("runs") as bar:
        bar.add_task("[/green]", total=1)
    shown = capsys.readouterr()
    for name in ("[/bold]", "[/red]:smile:"):
        assert name in shown.out
    assert "[/green]" in shown.err


def test_lines_of_plots_show_on_white_paper():
    linear = np.array(media.colours(21)) ** 2.2
    contrast = 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05)
    assert contrast.min() > 1.99
    assert len({tuple(np.round(colour, 2)) for colour in media.colours(7)}) == 7


@pytest.mark.parametrize(
    "command", ["evaluate", "tune", "track boxes", "track contours", "reproduce", "contour learn"]
)
def test_help_has_no_stray_blanks(command):
    shown = jaxpf(*command.split(), "--help").out
    assert "\n\n\n" not in shown
    assert not re.search(r"[ \t]\n", shown)
    description = re.split(r"\n\n(?=\S)", shown)[0].split("\n\n", 1)[1]
    for line in filter(None, description.split("\n")):
        assert re.match(r"  \S", line), line
        assert not re.search(r"[^.:!?]  +\S", line.strip()), line


@pytest.mark.parametrize(
    ("command", "default"),
    [
        ("track boxes", "300"),
        ("track points", "1000"),
        ("track contours", "500"),
        ("evaluate", "300"),
        ("tune", "100"),
    ],
)
def test_help_shows_the_number_of_particles_and_names_the_effect_first(command, default):
    every = jaxpf(*command.split(), "--help").out
    counted = f"Number of particles; of eskil and pffl, of each object. [default: {default}]"
    assert counted in " ".join(every.split())
    scope_first = (
        r"  (Of (points|parts|contours|centrelines|relative|discrim)|For sps|With --detections:)"
    )
    assert not re.search(scope_first, every)
    assert not re.search(r"TEXT +(none|systematic|clip|mean), ", every)  # the choices stand last
