"""The small scene for the command line: as options, and as a folder with pictures and truth."""

from clips import write_pictures, write_table
from small_evaluation import PARAMETERS, small_scene

SMALL = [text for name, value in PARAMETERS.items() for text in ("--set", f"{name}={value}")]


def write_sequence(folder):
    """The small scene as a folder with pictures and truth."""
    scene = small_scene()
    write_pictures(folder, scene.frames, "{:04d}.png")
    rows = (
        (number, identity, box, 0)
        for number, boxes in enumerate(scene.boxes)
        for identity, box in zip((7, 3), boxes, strict=True)
    )
    write_table(folder / "gt.csv", "frame,id,x,y,w,h,occ", *rows)
    height, width = scene.frames.shape[1:3]
    (folder / "meta.json").write_text(
        f'{{"name": "two", "frames": "%04d.png", "n_frames": {len(scene.frames)}, '
        f'"width": {width}, "height": {height}, "fps": 25}}'
    )
    return folder
