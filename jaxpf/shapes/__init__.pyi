from .depth import depth_orders as depth_orders, in_front as in_front
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
    cos_sin as cos_sin,
    intersection_area as intersection_area,
    is_proper as is_proper,
    rotate as rotate,
)
from .spaces import (
    ShapeSpace as ShapeSpace,
    check_contours as check_contours,
    key_frame_space as key_frame_space,
    space_of as space_of,
)
from .splines import (
    CUBIC as CUBIC,
    basis as basis,
    check_order as check_order,
    crosses_itself as crosses_itself,
    even_places as even_places,
    fit_spline as fit_spline,
    points_on as points_on,
    resample_polyline as resample_polyline,
)
