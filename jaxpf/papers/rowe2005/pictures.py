"""Figures 5 and 6 of the paper: one run in pictures, on its synthetic test and on traffic.

The paper's two traffic sequences were never published.  The nearest of the clips is a car that
drives through shadow, alone; it is followed with the settings of the synthetic test, which were not
chosen for it.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf.evaluation.opening import load_scene
from jaxpf.media import plotting
from jaxpf.media.overlay import draw_boxes
from jaxpf.papers.measuring.checkpoints import part
from jaxpf.papers.measuring.grid import run_keys
from jaxpf.papers.rowe2005.scenes import tracker
from jaxpf.shapes.rectangles import intersection_area

CLIP = "davis_car-shadow"
_SHOWN = 4

#: Of a run: frames ``[4, H, W, 3]``, their numbers ``[4]``, estimated boxes ``[4, L, 4]``, and the
#: mean overlap with the true boxes, ``[L]``.
Pictures = Mapping[str, np.ndarray]


def measure(data: Path | None, seed: int, num_frames: int | None = None) -> Mapping[str, Pictures]:
    """``figure_5``, and ``figure_6`` where the folder of clips holds the car."""
    shorter = {} if num_frames is None else {"num_frames": num_frames}
    drawn = partial(scenes.make, "projectiles", seed=seed, **shorter)
    found = {"figure_5": part("figure_5", lambda: _followed(drawn(), seed))}
    if data is not None and (folder := data / CLIP).is_dir():
        read = partial(load_scene, str(folder), num_frames=num_frames)
        found["figure_6"] = part("figure_6", lambda: _followed(read(), seed))
    return found


def figures(found: Mapping[str, Pictures]) -> dict[str, Any]:
    """Both by the stem of their files."""
    return {name: _drawn(pictures) for name, pictures in found.items()}


def _followed(scene: Any, seed: int) -> dict[str, np.ndarray]:
    frames = np.stack([np.asarray(frame) for frame in scene.frames])
    key = run_keys(seed, np.arange(1))[0]
    estimates = np.asarray(
        jaxpf.run(tracker(scene), key, jnp.asarray(frames[1:]), lambda state, summary: summary)[
            1
        ].estimate
    )
    boxes = np.concatenate([estimates[..., :2] - estimates[..., 2:4] / 2, estimates[..., 2:4]], -1)
    truth = np.asarray(scene.boxes[1:], float)
    common = np.asarray(intersection_area(boxes, truth))
    areas = (boxes[..., 2:].prod(axis=-1), truth[..., 2:].prod(axis=-1))
    chosen = np.linspace(0, len(boxes) - 1, _SHOWN).round().astype(int)
    return {
        "frames": frames[1:][chosen],
        "numbers": chosen + 1,
        "boxes": boxes[chosen],
        "overlap": np.nanmean(common / (sum(areas) - common), axis=0),
    }


def _drawn(pictures: Pictures) -> Any:
    figure, axes = plotting.new_figure(1, _SHOWN, figsize=(14, 3.2))
    shown = zip(axes[0], pictures["frames"], pictures["numbers"], pictures["boxes"], strict=True)
    for axis, frame, number, boxes in shown:
        axis.imshow(draw_boxes(frame, boxes))
        axis.set_title(f"frame {number}", fontsize=9)
        axis.axis("off")
    overlap = ", ".join(f"{100 * each:.0f}" for each in pictures["overlap"])
    figure.suptitle(f"mean overlap with the true boxes, %: {overlap}", fontsize=10)
    return figure
