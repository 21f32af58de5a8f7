from .following import follow as follow
from .lifetimes import (
    EMPTY as EMPTY,
    Changes as Changes,
    Ended as Ended,
    Living as Living,
    Refusal as Refusal,
    Rules as Rules,
    Started as Started,
    advance as advance,
    start_empty as start_empty,
)
from .population import (
    open_box_tracker as open_box_tracker,
    open_model as open_model,
)
from .records import (
    Group as Group,
    Record as Record,
)
