"""``jaxpf frame``: one frame with a pixel grid."""

from pathlib import Path

import click
import cv2

from jaxpf.cli.shared import plain
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.plain import PlainCommand
from jaxpf.contract.errors import InputError
from jaxpf.files.writing import atomic_write, check_output_file
from jaxpf.media.overlay import draw_pixel_grid
from jaxpf.media.video import open_frames


@click.command("frame", cls=PlainCommand)
@click.argument("video")
@plain.whole("--number", "-n", default=0, most=2**31 - 1, help="Frame, counting from 0.")
@plain.whole(
    "--step",
    default=None,
    least=1,
    most=10_000,
    help="Pixels between grid lines.  [default: by the picture's size]",
)
@plain.grey_range
@plain.output("PNG file to write.  [default: NAME-frame-NUMBER.png]")
@plain.overwrite_file
def command(
    video: str,
    number: int,
    step: int | None,
    range: tuple[int, int] | None,
    output: Path | None,
    overwrite: bool,
) -> None:
    """Save one frame of VIDEO with a pixel grid, to read boxes, points and contours off.

    A box is x,y,w,h: the pixel of its top left corner, its width and its height.  VIDEO may be
    live, as for `jaxpf track`: `jaxpf frame 0 -n 30` skips 30 frames so that camera 0 can adjust
    its exposure.
    """
    if output is not None and output.suffix.lower() != ".png":
        raise InputError(f"output '{output}' must end in .png; rename it.")
    source = open_frames(video, range=range)
    output = output or Path(f"{source.name}-frame-{number}.png")
    if isinstance(source.path, Path) and output.parent.resolve() == source.path.resolve():
        raise InputError(
            f"output '{output}' would lie among the frames of '{source.path}'; choose another "
            "--output."
        )
    check_output_file(output, overwrite=overwrite)
    picture = draw_pixel_grid(next(source.frames(number)), step)
    done, encoded = cv2.imencode(".png", picture[..., ::-1])
    if not done:
        raise RuntimeError("OpenCV could not encode a PNG image")
    with atomic_write(output, "wb") as file:
        file.write(encoded.tobytes())
    say(f"{output}: frame {number} of '{source.path}', {source.width}x{source.height} pixels")
    if source.note:
        say(f"Note: {source.note}", err=True)
