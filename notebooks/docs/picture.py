"""Draw the README's picture, and photograph the page of ``jaxpf view``, from a run.

``python notebooks/docs/picture.py`` needs chromium and its driver.  A PNG's text says which code
drew it, and how wide the bands are that the README's shows.
"""

import hashlib
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from jaxpf import media
from jaxpf.boxes import read_tracks

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / ".assets" / "track.png"
REVIEW = ROOT / ".assets" / "view.png"
FRAME = 42
#: The code whose change may make another picture of the same tracks.
DRAWN_BY = (
    "notebooks/docs/picture.py",
    "jaxpf/media/overlay.py",
    "scenes/articulated.py",
    "scenes/deforming.py",
    "scenes/drawing.py",
    "scenes/street.py",
)
PAGE = (
    "notebooks/docs/picture.py",
    *(f"jaxpf/media/page/page.{kind}" for kind in ("html", "css", "js")),
)
COMMANDS = (
    "example boxes street",
    "track street/clip.mp4 --boxes street/start.csv -o street/tracks",
)


def digest(names: tuple[str, ...] = DRAWN_BY) -> str:
    """Return a digest of the code that draws a picture."""
    return hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in names)).hexdigest()


def main() -> None:
    """Track the example; draw a frame of its overlay beside x of all objects, and its review."""
    with tempfile.TemporaryDirectory() as folder:
        for command in COMMANDS:
            program = [sys.executable, "-m", "jaxpf", *command.split()]
            subprocess.run(program, cwd=folder, check=True)
        draw(Path(folder, "street", "tracks"), PICTURE)
        review(Path(folder, "street", "tracks"), REVIEW)


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


def review(folder: Path, output: Path) -> None:
    """Photograph ``jaxpf view`` at the first doubtful frame of a folder of tracks."""
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--window-size=1100,800"):
        options.add_argument(argument)
    options.binary_location = shutil.which("chromium") or ""
    service = webdriver.ChromeService(shutil.which("chromedriver"))
    command = [sys.executable, "-m", "jaxpf", "view", str(folder), "--no-open"]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program,
        webdriver.Chrome(options=options, service=service) as browser,
    ):
        browser.get(program.stdout.readline().strip())
        until = WebDriverWait(browser, 20).until
        until(lambda browser: browser.execute_script("return results[0]?.rows.size > 80"))
        browser.find_element(By.TAG_NAME, "body").send_keys("n")
        until(lambda browser: "doubtful" in browser.find_element(By.ID, "status").text)
        browser.execute_async_script("setTimeout(arguments[0], 1000)")  # the picture has come
        browser.save_screenshot(str(output))
        program.terminate()
    about = PngInfo()
    about.add_text("Drawn by", digest(PAGE))
    Image.open(output).convert("P", palette=Image.Palette.ADAPTIVE).save(output, pnginfo=about)


if __name__ == "__main__":
    main()
