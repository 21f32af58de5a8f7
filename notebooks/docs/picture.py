"""Draw the README's picture from a run of ``jaxpf track``: python notebooks/docs/picture.py.

The PNG's text says which code drew it, and how wide the bands are that it shows.
"""

import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from jaxpf import media
from jaxpf.boxes import read_tracks

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / ".assets" / "track.png"
FRAME = 42
#: The code whose change may make another picture of the same tracks.
DRAWN_BY = (
    "notebooks/docs/picture.py",
    "jaxpf/media/labels.py",
    "jaxpf/media/overlay.py",
    "scenes/articulated.py",
    "scenes/deforming.py",
    "scenes/drawn_outlines.py",
    "scenes/street.py",
)
COMMANDS = (
    "example boxes street",
    "track street/clip.mp4 --boxes street/start.csv -o street/tracks",
)


def digest() -> str:
    """Return a digest of the code that draws the picture."""
    return hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in DRAWN_BY)).hexdigest()


def main(output: Path = PICTURE) -> None:
    """Track the example, and draw a frame of its overlay beside x of all objects."""
    with tempfile.TemporaryDirectory() as folder:
        for command in COMMANDS:
            program = [sys.executable, "-m", "jaxpf", *command.split()]
            subprocess.run(program, cwd=folder, check=True)
        draw(Path(folder, "street", "tracks"), output)


def draw(folder: Path, output: Path) -> None:
    """Draw the picture of a folder of tracks."""
    table = read_tracks(folder / "tracks.csv")
    picture = next(media.open_frames(str(folder / "overlay.mp4")).frames(FRAME))
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10, 3.1), layout="constrained", width_ratios=(1.15, 1)
    )
    left.imshow(picture)
    left.set(xticks=[], yticks=[])
    left.set_title(f"frame {FRAME}: boxes, particles, two standard deviations", fontsize=9)
    numbers, widths = np.unique(table["id"]), []
    for number, colour in zip(numbers, media.colours(len(numbers)), strict=True):
        rows = table["id"] == number
        time, low, high = (table[name][rows] for name in ("time", "centre_x_2.5", "centre_x_97.5"))
        right.plot(
            time, (table["x"] + table["w"] / 2)[rows], color=colour, label=f"object {number}"
        )
        right.fill_between(time, low, high, color=colour, alpha=0.3, linewidth=0)
        widths.append(f"{np.nanmedian(high - low):.0f}")
    right.set(xlabel="time (s)", ylabel="x of the centre (pixels)")
    right.set_title("trajectories and their 95% intervals", fontsize=9)
    right.grid(alpha=0.3)
    right.legend(fontsize=8)
    made = {"Drawn by": digest(), "Median widths in pixels": " ".join(widths)}
    figure.savefig(output, dpi=100, metadata=made)


if __name__ == "__main__":
    main()
