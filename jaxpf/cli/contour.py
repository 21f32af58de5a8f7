"""``jaxpf contour learn``: shape space and dynamics of contours, from annotations."""

from pathlib import Path
from typing import Any

import click

from jaxpf.cli.shared import flags
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import Command, GivenPath
from jaxpf.cli.shared.startup import use_compile_cache
from jaxpf.contours.files import write_learned
from jaxpf.contours.learning import learn_contours, read_annotated
from jaxpf.dynamics.learned import COEFFICIENTS
from jaxpf.files.writing import check_output_file
from jaxpf.shapes.learning import ANNOTATIONS


@click.group("contour")
def command() -> None:
    """Learn what contours look like and how they move."""


@command.command("learn", cls=Command)
@click.argument("folder", type=GivenPath())
@click.option(
    "--kind",
    type=click.Choice(ANNOTATIONS),
    help="What FOLDER holds: masks (a folder of pictures, or its folder masks), outlines "
    "(outlines.csv) or centrelines (centrelines.csv).  [default: whichever is there]",
)
@click.option(
    "--object",
    "value",
    type=int,
    help="Number of the object in masks: its palette index or grey level.",
)
@click.option("--first", default=0, show_default=True, help="First frame to learn from, from 0.")
@click.option("--last", type=int, help="Last frame to learn from.  [default: the last]")
@click.option(
    "--dimension", "-d", default=8, show_default=True, help="Dimensions of the shape space."
)
@click.option(
    "--points",
    "num_points",
    default=12,
    show_default=True,
    help="Control points of a contour, as many as the start contours have: `jaxpf mark` writes 12 "
    "for open and 16 for closed ones.",
)
@flags.whole(
    "--turns",
    default=0,
    most=360,
    help="Also learn copies rotated to N directions, mirrored and reversed (centrelines only); for "
    "bodies that lie in any direction and bend to either side.",
)
@flags.whole(
    "--order",
    default=2,
    most=2,
    help="Number of past frames that the dynamics use; 0 learns no dynamics.",
)
@click.option(
    "--coefficients",
    type=click.Choice(COEFFICIENTS),
    default=COEFFICIENTS[0],
    show_default=True,
    help="What a coordinate's motion depends on: its own last steps, its own past with a mean to "
    "which it returns, or the past of all coordinates.",
)
@flags.output("File for `jaxpf track --learned`.", "learned.json")
@flags.overwrite_file
def learn(
    folder: Path,
    kind: str | None,
    value: int | None,
    first: int,
    last: int | None,
    output: Path,
    overwrite: bool,
    **settings: Any,
) -> None:
    """Learn a shape space and dynamics from the contours in FOLDER.

    A CSV file has the header frame,id,k,x,y: the k-th point of a target's outline or centreline
    in a frame, in pixels.  Frames need not all be annotated; all targets are learned as one kind.

    Example: jaxpf contour learn worms --turns 36 -d 10 --last 40 -o worm.json
    """
    check_output_file(output, overwrite=overwrite)
    annotated = read_annotated(folder, kind, value=value, first=first, last=last)
    use_compile_cache()
    learned, report = learn_contours(annotated, **settings)
    write_learned(output, learned)
    for line in report:
        say(line)
    say(f"{output}: for `jaxpf track contours VIDEO --contours FILE.json --learned {output}`")
