from .data import Contours as Contours
from .factory import to_contours as to_contours, tracker as tracker
