"""The small scene for the command line: as options, and as a folder with pictures and truth."""

import cv2
from small_evaluation import PARAMETERS, small_scene

SMALL = [text for name, value in PARAMETERS.items() for text in ("--set", f"{name}={value}")]


def write_sequence(folder):
    """The small scene as a folder with pictures and truth."""
    scene = small_scene()
    folder.mkdir()
    rows = ["frame,id,x,y,w,h,occ"]
    for number, (frame, boxes) in enumerate(zip(scene.frames, scene.boxes, strict=True)):
        cv2.imwrite(str(folder / f"{number:04d}.png"), frame[..., ::-1])
        for identity, box in zip((7, 3), boxes, strict=True):
            rows.append(f"{number},{identity},{','.join(map(str, box))},0")
    (folder / "gt.csv").write_text("\n".join(rows) + "\n")
    height, width = scene.frames.shape[1:3]
    (folder / "meta.json").write_text(
        f'{{"name": "two", "frames": "%04d.png", "n_frames": {len(scene.frames)}, '
        f'"width": {width}, "height": {height}, "fps": 25}}'
    )
    return folder
