"""How bright spots are asked for, read, written and drawn."""

from collections.abc import Mapping

from own_target import SPOTS

from jaxpf import InputError
from jaxpf.points import draw_points
from jaxpf.points.files import parse_points
from jaxpf.targets.adapter import Adapter


class SpotAdapter(Adapter):
    target = SPOTS
    example = "--spot 120,80"
    start_flags: Mapping = {
        "spot": {"multiple": True, "metavar": "X,Y", "help": "A spot; repeat it."}
    }

    def read_start(self, given, number, source):
        if not given["spot"]:
            raise InputError("no spot: give --spot x,y for every one.")
        found = parse_points(given["spot"])
        return SPOTS.start(found.places, found.names)

    def fits_scene(self, scene):
        return "spots" in scene.extras

    def scene_shapes(self, scene):
        return scene.extras["spots"]

    def scene_start(self, scene):
        return SPOTS.start(scene.extras["spots"][0])

    def draw(self, frame, start, shapes, marks):
        return draw_points(frame, shapes, colours=marks.colours, names=list(start.ids))


ADAPTER = SpotAdapter()
