from .drawing import draw_points as draw_points
from .factory import shapes as shapes, tracker as tracker
