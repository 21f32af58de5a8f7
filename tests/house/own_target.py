"""A target of one's own: bright spots, with a motion and a likelihood of its own."""

from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.contract import Option
from jaxpf.contract.model import Model
from jaxpf.points import draw_points
from jaxpf.points.files import parse_points
from jaxpf.targets import Start, Target


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


@jaxpf.targets.factory("spots")
def tracker(
    frame,
    spots,
    *,
    step: Annotated[float, Option("Noise per frame, pixels.", above=0)] = 3.0,
    **options: Any,
):
    places = spots.shapes.astype(np.float32)
    model = Model(Hops(step), Brightness(), places, spots.parents)
    return jaxpf.filters.build(model, **options)


def start(spots, names=None):
    places = np.asarray(spots, float)
    ids = np.arange(len(places)) if names is None else np.asarray(names)
    return Start(ids, places, np.ones_like(places), (-1,) * len(places))


def outlines(shapes, sizes):
    corners = jnp.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return jnp.asarray(shapes)[..., None, :] + corners


# For the command line: how spots are asked for, read from scenes, and drawn.


def read_start(given, number, source):
    if not given["spot"]:
        raise jaxpf.InputError("no spot: give --spot x,y for every one.")
    found = parse_points(given["spot"])
    return start(found.places, found.names)


def draw(frame, start, shapes, marks):
    return draw_points(frame, shapes, colours=marks.colours, names=list(start.ids))


SPOTS = Target(
    name="spots",
    tracker=tracker,
    start=start,
    outlines=outlines,
    read_start=read_start,
    draw=draw,
    scene_shapes=lambda scene: scene.extras.get("spots"),
    scene_start=lambda scene: start(scene.extras["spots"][0]),
    start_flags={"spot": {"multiple": True, "metavar": "X,Y", "help": "A spot; repeat it."}},
    example="--spot 120,80",
)
jaxpf.targets.register(SPOTS)
