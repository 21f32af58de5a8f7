from .factory import to_contours as to_contours, tracker as tracker
from .files import Contours as Contours
