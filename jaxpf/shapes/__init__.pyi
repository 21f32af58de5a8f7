from .depth import in_front as in_front
from .learning import (
    augment as augment,
    learn_shape_space as learn_shape_space,
    outline_of as outline_of,
)
from .rectangles import (
    area as area,
    boxes_from_substates as boxes_from_substates,
    centres as centres,
    corners_from_poses as corners_from_poses,
    intersection_area as intersection_area,
)
from .spaces import (
    ShapeSpace as ShapeSpace,
    key_frame_space as key_frame_space,
    space_of as space_of,
)
from .splines import (
    basis as basis,
    fit_spline as fit_spline,
    points_on as points_on,
    resample_polyline as resample_polyline,
)
