from .calibration import crps as crps, log_score as log_score, pit_values as pit_values
from .intervals import (
    Interval as Interval,
    difference_interval as difference_interval,
    mean_interval as mean_interval,
    median_interval as median_interval,
)
from .metrics import iou as iou, success as success, summarise as summarise
from .particle_sets import effective_sample_size as effective_sample_size
from .points import point_distances as point_distances
from .scores import tracking_scores as tracking_scores
