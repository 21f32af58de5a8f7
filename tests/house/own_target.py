"""A target of one's own: bright spots, with a motion and a likelihood of its own."""

import dataclasses
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.contract.model import Model
from jaxpf.contract.options import check_options, option
from jaxpf.points import draw_points
from jaxpf.points.files import parse_points
from jaxpf.targets.target import Start, Target


@dataclasses.dataclass(frozen=True)
class Options:
    step: float = option(3.0, "Noise per frame, pixels.", above=0, path="dynamics.step")

    def __post_init__(self):
        check_options(self)


@jaxpf.pytree_dataclass
class Hops:
    step: float

    def propagate(self, key, partition, current, previous, parent):
        return current + self.step * jax.random.normal(key, current.shape)


@jaxpf.pytree_dataclass
class Brightness:
    def observe(self, frame):
        return frame.mean(axis=-1) / 255.0

    def log_prob(self, observation, partition, substate):
        last = jnp.array(observation.shape[::-1]) - 1
        column, row = jnp.clip(jnp.floor(substate), 0, last).astype(int)
        return 10.0 * observation[row, column]


class Spots(Target):
    name = "spots"
    options = Options
    example = "--spot 120,80"
    start_flags: Mapping = {
        "spot": {"multiple": True, "metavar": "X,Y", "help": "A spot; repeat it."}
    }

    def start(self, given, names=None):
        places = np.asarray(given, float)
        ids = np.arange(len(places)) if names is None else np.asarray(names)
        return Start(ids, places, np.ones_like(places), (-1,) * len(places))

    def likelihood(self, options, start, looks):
        return Brightness()

    def model(self, options, start, likelihood):
        places = start.shapes.astype(np.float32)
        return Model(Hops(options.step), likelihood, places, start.parents)

    def shapes(self, start, estimate, tracker):
        return np.asarray(estimate)

    def outlines(self, start, shapes):
        corners = jnp.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return jnp.asarray(shapes)[..., None, :] + corners

    # For the command line: how spots are asked for, read from scenes, and drawn.

    def read_start(self, given, number, source):
        if not given["spot"]:
            raise jaxpf.InputError("no spot: give --spot x,y for every one.")
        found = parse_points(given["spot"])
        return self.start(found.places, found.names)

    def fits_scene(self, scene):
        return "spots" in scene.extras

    def scene_shapes(self, scene):
        return scene.extras["spots"]

    def scene_start(self, scene):
        return self.start(scene.extras["spots"][0])

    def draw(self, frame, start, shapes, marks):
        return draw_points(frame, shapes, colours=marks.colours, names=list(start.ids))


SPOTS = Spots()
