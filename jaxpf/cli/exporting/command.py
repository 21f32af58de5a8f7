"""``jaxpf export``: write results in the formats of other projects."""

from pathlib import Path

import click

from jaxpf.cli.shared import plain
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.plain import GivenPath, PlainCommand
from jaxpf.contract.errors import InputError
from jaxpf.files.writing import check_output_file

_FORMATS = ["coco", "cvat", "mot", "dlc", "sleap"]


@click.command("export", cls=PlainCommand)
@click.argument("folder", type=GivenPath())
@click.argument("form", metavar="FORMAT", type=click.Choice(_FORMATS))
@click.argument("output", metavar="FILE", type=GivenPath())
@plain.overwrite_file
def command(folder: Path, form: str, output: Path, overwrite: bool) -> None:
    """Write the tracks of `jaxpf track` in FOLDER to FILE, in FORMAT.

    coco: JSON with boxes, polygons or keypoints.  cvat: the archive that CVAT imports as "MOT
    1.1".  mot: text lines of the MOTChallenge, which count from 1.  dlc: keypoints as DeepLabCut's
    table of predictions.  sleap: keypoints as SLEAP's analysis CSV.

    Example: jaxpf export jaxpf-clip coco tracks.json
    """
    from jaxpf.cli.exporting.formats import FORMATS, read_tracked

    suffix, write = FORMATS[form]
    if output.suffix != suffix:
        raise InputError(f"output '{output}' must end in {suffix}; rename it.")
    check_output_file(output, "FILE", overwrite)
    tracked = read_tracked(folder)
    write(output, tracked)
    count, frames = len(tracked.names), len(tracked.times)
    say(f"{output}: {count} {tracked.target} in {frames} frames")
