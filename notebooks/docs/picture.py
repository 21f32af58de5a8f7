"""Draw the README's picture from a run of ``jaxpf track``.

jaxpf example boxes street
jaxpf track street/clip.mp4 --boxes street/start.csv -o street/tracks
python notebooks/docs/picture.py street/tracks .assets/track.png
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from jaxpf import media
from jaxpf.boxes import read_tracks

FRAME = 42


def main(folder: Path, output: Path) -> None:
    """Draw a frame of the overlay beside x of all objects with its band."""
    table = read_tracks(folder / "tracks.csv")
    picture = next(media.open_frames(str(folder / "overlay.mp4")).frames(FRAME))
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10, 3.1), layout="constrained", width_ratios=(1.15, 1)
    )
    left.imshow(picture)
    left.set(xticks=[], yticks=[])
    left.set_title(f"frame {FRAME}: boxes, particles, two standard deviations", fontsize=9)
    numbers = np.unique(table["id"])
    for number, colour in zip(numbers, media.colours(len(numbers)), strict=True):
        rows = table["id"] == number
        time, low, high = (table[name][rows] for name in ("time", "x_2.5", "x_97.5"))
        right.plot(time, table["x"][rows], color=colour, label=f"object {number}")
        right.fill_between(time, low, high, color=colour, alpha=0.3, linewidth=0)
    right.set(xlabel="time (s)", ylabel="x of the left edge (pixels)")
    right.set_title("trajectories and their 95% intervals", fontsize=9)
    right.grid(alpha=0.3)
    right.legend(fontsize=8)
    figure.savefig(output, dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
