"""``jaxpf export``: results in the formats of other projects."""

from pathlib import Path

import click

from jaxpf.errors import InputError


@click.command("export")
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("form", metavar="FORMAT", type=click.Choice(["coco", "cvat", "movement"]))
@click.argument("output", metavar="FILE", type=click.Path(path_type=Path))
@click.option("--overwrite", is_flag=True, help="Replace the file if it is there.")
def command(folder: Path, form: str, output: Path, overwrite: bool) -> None:
    """Write the tracks in FOLDER, which `jaxpf track` filled, to FILE in another project's FORMAT.

    coco: JSON with boxes, polygons or key points.  cvat: the archive that CVAT imports as "MOT
    1.1".  movement: netCDF with positions, confidence and, where they are known, intervals; needs
    the extra `formats`.

    Example: jaxpf export jaxpf-clip coco tracks.json
    """
    from jaxpf.files.exports import FORMATS, read_tracked
    from jaxpf.files.writing import check_output_file

    suffix, write = FORMATS[form]
    if output.suffix != suffix:
        raise InputError(f"output '{output}' must end in {suffix}; rename it.")
    if output.exists() and not overwrite:
        raise InputError(f"'{output}' is there already; choose another FILE or --overwrite.")
    check_output_file(output)
    tracked = read_tracked(folder)
    write(output, tracked)
    count, frames = len(tracked.names), len(tracked.lines)
    click.echo(f"{output}: {count} {tracked.target} in {frames} frames")
