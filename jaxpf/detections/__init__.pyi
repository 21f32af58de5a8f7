from .following import (
    TrackedObjects as TrackedObjects,
    follow as follow,
    open_box_tracker as open_box_tracker,
    open_model as open_model,
)
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
