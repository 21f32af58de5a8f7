"""A small scene and plans on it, which worker processes can import too."""

import dataclasses
import functools
from pathlib import Path

import numpy as np

from jaxpf.evaluation import Plan
from jaxpf.evaluation.scene import load_scene

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
#: Where a started program finds this module.
HERE = Path(__file__).parent
#: One shape for all tests, so that the kernel is compiled once.
PARTICLES, RUNS = 60, 25
#: Options of the command line, of that shape, too.
COMMON = (
    "--methods",
    "sir,ps",
    "--orders",
    "shifts",
    "-n",
    PARTICLES,
    "--noise-pixels",
    "1,1,.001",
    "--runs",
    "4",
)
#: Two files per configuration.
TWICE = 2 * RUNS

small_scene = functools.partial(load_scene, source="distracter", seed=0, parameters=PARAMETERS)


def small_plan(scene=small_scene, **given):
    """SIR and DPS, one batch each, unless something else is asked; other names are the grid's."""
    own = {field.name for field in dataclasses.fields(Plan)}
    grid = {
        "num_particles": (PARTICLES,),
        "noise_pixels": ((1.0, 1.0, 0.001),),
        "likelihood": ("integral",),
    }
    grid |= given.pop("grid", {})
    grid |= {name: values for name, values in given.items() if name not in own}
    settings = {"methods": ("sir", "dps"), "runs": RUNS, "grid": grid}
    return Plan(scene, **(settings | {n: value for n, value in given.items() if n in own}))


def content(results):
    """Every array of every run, by configuration; batches joined."""
    found = {}
    for index, configuration in enumerate(results.configurations):
        parts = list(results.batches(configuration))
        for name in vars(parts[0]):
            found[index, name] = np.concatenate([getattr(part, name) for part in parts])
    return found


def assert_equal_bits(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=str(name))
        assert one[name].dtype == other[name].dtype


def names(folder):
    return sorted(path.name for path in (folder / "batches").iterdir())


def stamps(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "batches").iterdir()}
