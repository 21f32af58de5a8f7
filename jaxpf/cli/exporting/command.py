"""``jaxpf export``: write results in the formats of other projects."""

from pathlib import Path

import click

from jaxpf.cli.shared.speaking import GivenPath, Speaking
from jaxpf.contract.errors import InputError


@click.command("export", cls=Speaking)
@click.argument("folder", type=GivenPath())
@click.argument(
    "form",
    metavar="FORMAT",
    type=click.Choice(["coco", "cvat", "mot", "movement", "arviz"]),
)
@click.argument("output", metavar="FILE", type=GivenPath())
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def command(folder: Path, form: str, output: Path, overwrite: bool) -> None:
    """Write the tracks of `jaxpf track` in FOLDER to FILE, in FORMAT.

    coco: JSON with boxes, polygons or key points.  cvat: the archive that CVAT imports as "MOT
    1.1".  mot: text lines of the MOTChallenge, which count from 1.  movement: netCDF with
    positions and confidence.

    arviz: netCDF of an evaluation that `jaxpf evaluate` wrote to FOLDER, with runs as chains and
    frames as draws.  arviz and movement need the extra `formats`.

    Example: jaxpf export jaxpf-clip coco tracks.json
    """
    from jaxpf.cli.exporting.formats import FORMATS, read_tracked
    from jaxpf.files.writing import check_output_file

    of_evaluation = form == "arviz"
    suffix = ".nc" if of_evaluation else FORMATS[form][0]
    if output.suffix != suffix:
        raise InputError(f"output '{output}' must end in {suffix}; rename it.")
    if output.exists() and not overwrite:
        raise InputError(f"'{output}' exists; choose another FILE or add --overwrite.")
    check_output_file(output)
    if of_evaluation:
        from jaxpf.evaluation import Results
        from jaxpf.evaluation.output.datatree import write_datatree

        results = Results.open(folder)
        write_datatree(output, results)
        click.echo(f"{output}: {results.scene_name}, {results.runs} runs of each configuration")
        return
    tracked = read_tracked(folder)
    FORMATS[form][1](output, tracked)
    count, frames = len(tracked.names), len(tracked.times)
    click.echo(f"{output}: {count} {tracked.target} in {frames} frames")
