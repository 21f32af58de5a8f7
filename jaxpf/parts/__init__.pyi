from .factory import to_parts as to_parts, tracker as tracker
from .files import Parts as Parts
