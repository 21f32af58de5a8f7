from .engine import (
    Pool as Pool,
    Prepared as Prepared,
    carry_out as carry_out,
    evaluate as evaluate,
    local_pool as local_pool,
    prepare as prepare,
)
from .plan import Plan as Plan
from .results import Batch as Batch, Configuration as Configuration, Results as Results
