"""``jaxpf detections``: simulate a detector's output for a video with ground truth."""

from pathlib import Path

import click

from jaxpf.cli.shared.speaking import GivenPath, Speaking
from jaxpf.contract.errors import InputError


@click.command("detections", cls=Speaking)
@click.argument("video", type=GivenPath())
@click.argument("truth", type=GivenPath())
@click.option(
    "--misses", default=0.2, show_default=True, help="Share of the objects that are missed."
)
@click.option("--false-alarms", default=0.5, show_default=True, help="Mean number per frame.")
@click.option(
    "--jitter",
    default=0.05,
    show_default=True,
    help="Error of position and size, as a share of the size.",
)
@click.option("--seed", default=0, show_default=True, help="Random seed.")
@click.option(
    "--output",
    "-o",
    type=GivenPath(),
    default=Path("det.txt"),
    show_default=True,
    help="File to write.",
)
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def command(
    video: Path,
    truth: Path,
    misses: float,
    false_alarms: float,
    jitter: float,
    seed: int,
    output: Path,
    overwrite: bool,
) -> None:
    """Simulate detections of the boxes in TRUTH, a CSV as for `jaxpf track --boxes`.

    The file is for `jaxpf track --births`, on clips without detections.  Its errors are independent
    from frame to frame; those of a real detector are not.  Compare trackers on the same file, and
    do not compare scores with published ones.
    """
    import numpy as np

    from jaxpf.boxes.tracks import dense, read_boxes
    from jaxpf.evaluation.baselines.simulated_detections import simulated_detections
    from jaxpf.files.writing import check_output_file
    from jaxpf.media.video import open_frames
    from jaxpf.populations.detections import write_detections

    if not 0 <= seed < 2**32:
        raise InputError(f"--seed {seed} must be between 0 and {2**32 - 1}.")
    if output.resolve() in (video.resolve(), truth.resolve()):
        raise InputError(f"output '{output}' is also an input; choose another --output.")
    if output.exists() and not overwrite:
        raise InputError(f"'{output}' exists; choose another --output or add --overwrite.")
    check_output_file(output)
    source, table = open_frames(video), read_boxes(truth, empty_boxes="absent")
    if source.is_live:
        raise InputError(f"'{video}' is live, so it has no ground truth; record a video first.")
    num_frames = source.num_frames or sum(1 for _ in source)
    if not np.any(table.frame < num_frames):
        raise InputError(
            f"{table.source} has no box in the {num_frames} frames of '{video}', from 0 to "
            f"{num_frames - 1}; give the truth of this video."
        )
    boxes = dense(table, sorted(set(table.id.tolist())), num_frames)
    detections = simulated_detections(
        boxes,
        (source.height, source.width),
        misses=misses,
        false_alarms=false_alarms,
        jitter=jitter,
        seed=seed,
    )
    write_detections(output, detections)
    click.echo(f"{output}: {sum(map(len, detections))} detections in {num_frames} frames")
