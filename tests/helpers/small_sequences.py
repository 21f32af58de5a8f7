"""Small sequences as benchmarks write them, and what is said about a wrong one."""

import clips
import numpy as np
from refusals import message_of

from jaxpf.evaluation.scene import load_scene

SMALL = {"num_frames": 8, "frame_width": 120, "frame_height": 100, "num_objects": 2}
SEQINFO = (
    "[Sequence]\nname=made\nimDir=img1\nframeRate=12.5\nseqLength=8\nimWidth=120\n"
    "imHeight=100\nimExt=.png\n\n"
)
#: Of this project's layout.
OWN_HEADER = "frame,id,x,y,w,h,occ\n"
META = {"name": "made", "frames": "frames/%04d.png", "n_frames": 3, "width": 12, "height": 8}
META |= {"fps": 10}


def write_pictures(folder, frames, first=1, digits=6, suffix=".png"):
    return clips.write_pictures(folder, frames, f"{{:0{digits}d}}{suffix}", first)


def mot_rows(boxes, ids, tail="1,1,1"):
    """Lines of a gt.txt, by object as in the benchmark; frames, x and y from 1."""
    return [
        f"{t + 1},{number},{x + 1!r},{y + 1!r},{w!r},{h!r},{tail}"
        for column, number in enumerate(ids)
        for t, (x, y, w, h) in enumerate(boxes[:, column].tolist())
        if np.isfinite(x)
    ]


def otb_text(boxes, separator, end="\n"):
    """x and y from 1."""
    rows = boxes + np.array([1, 1, 0, 0])
    return "".join(separator.join(map(repr, row)) + end for row in rows.tolist())


def complaint_of(source, **options):
    return message_of(load_scene, source, **options)
