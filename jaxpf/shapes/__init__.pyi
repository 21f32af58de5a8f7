from .depth import in_front as in_front
from .learning import learn_shape_space as learn_shape_space
from .rectangles import boxes_from_substates as boxes_from_substates
from .spaces import (
    ShapeSpace as ShapeSpace,
    key_frame_space as key_frame_space,
    space_of as space_of,
)
