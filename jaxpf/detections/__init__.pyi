from .following import follow as follow
from .lifetimes import Rules as Rules
from .population import open_box_tracker as open_box_tracker
from .records import Record as Record
