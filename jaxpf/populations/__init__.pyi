from .following import (
    TrackedPopulation as TrackedPopulation,
    follow as follow,
    open_box_tracker as open_box_tracker,
    open_model as open_model,
)
from .lifetimes import (
    EMPTY as EMPTY,
    Birth as Birth,
    Changes as Changes,
    Death as Death,
    Living as Living,
    Refusal as Refusal,
    Rules as Rules,
    advance as advance,
    nobody as nobody,
)
