from .blocks import monte_carlo as monte_carlo
from .frames import num_frames as num_frames
from .runs import (
    as_key as as_key,
    forecast as forecast,
    frame_key as frame_key,
    frame_step as frame_step,
    init as init,
    one_run as one_run,
    ready as ready,
    run as run,
    run_compiled as run_compiled,
    summary_only as summary_only,
    together as together,
    with_rows as with_rows,
)
from .streaming import TrackedFrame as TrackedFrame, stream as stream
