from .drawing import draw_points as draw_points
from .factory import to_points as to_points, tracker as tracker
