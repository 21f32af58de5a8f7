from .following import follow as follow
from .lifetimes import EMPTY as EMPTY, Changes as Changes, Rules as Rules
from .population import open_box_tracker as open_box_tracker
from .records import Group as Group, Record as Record
