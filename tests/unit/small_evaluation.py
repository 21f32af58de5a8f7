"""A small scene and plans on it, which worker processes can import too."""

import functools

from jaxpf.evaluation import Plan
from jaxpf.experiments.sources import load_scene

#: Two objects in 40 x 30 pixels, 10 frames.
PARAMETERS = {
    "num_frames": 10,
    "frame_width": 40,
    "frame_height": 30,
    "num_objects": 2,
    "object_width": 6,
    "object_height": 8,
    "motion_scale": 0.5,
    "separation": 1.0,
    "frame_margin": 1.0,
    "lead_distance": 6.0,
    "leader_travel": 1.0,
    "vanish_frame": 6,
    "cell_size": 2,
}
#: One shape for all tests, so that the kernel is compiled once.
PARTICLES, RUNS = 60, 25

small_scene = functools.partial(load_scene, source="distracter", seed=0, parameters=PARAMETERS)


def small_plan(scene=small_scene, **given):
    """SIR and DPS, one batch each, unless something else is asked."""
    settings = {
        "methods": ("sir", "dps"),
        "particles": (PARTICLES,),
        "scale": ((1.0, 1.0, 0.001),),
        "likelihood": ("integral",),
        "runs": RUNS,
    }
    return Plan(scene, **(settings | given))
