from .plan import Limits as Limits, Plan as Plan
from .work.batches import Batch as Batch
from .work.engine import (
    Prepared as Prepared,
    carry_out as carry_out,
    evaluate as evaluate,
    finished as finished,
    prepare as prepare,
)
from .work.execution import Pool as Pool, local_pool as local_pool
from .work.other_tracks import match_tracks as match_tracks, read_tracks as read_tracks
from .work.results import Configuration as Configuration, Results as Results
