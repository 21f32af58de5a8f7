from .batches import Batch as Batch
from .engine import (
    Pool as Pool,
    Prepared as Prepared,
    carry_out as carry_out,
    evaluate as evaluate,
    finished as finished,
    local_pool as local_pool,
    prepare as prepare,
)
from .other_tracks import match_tracks as match_tracks, read_tracks as read_tracks
from .plan import Limits as Limits, Plan as Plan
from .results import Configuration as Configuration, Results as Results
