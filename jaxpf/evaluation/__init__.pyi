from .plan import Limits as Limits, Plan as Plan
from .work.batches import Batch as Batch
from .work.engine import (
    Opened as Opened,
    Prepared as Prepared,
    Settled as Settled,
    carry_out as carry_out,
    divide_work as divide_work,
    evaluate as evaluate,
    finished as finished,
    open_evaluation as open_evaluation,
    prepare as prepare,
    settle as settle,
)
from .work.execution import Pool as Pool, local_pool as local_pool
from .work.other_tracks import match_tracks as match_tracks, read_tracks as read_tracks
from .work.results import Configuration as Configuration, Results as Results
