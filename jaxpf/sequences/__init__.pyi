from .frames import Frames as Frames
from .layouts import open_sequence as open_sequence
from .sequence import Sequence as Sequence
