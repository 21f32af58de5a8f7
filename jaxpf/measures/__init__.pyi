from .association import pairwise_iou as pairwise_iou
from .calibration import (
    Reliability as Reliability,
    confidence_counts as confidence_counts,
    crps as crps,
    log_score as log_score,
    pit_values as pit_values,
    smallest_region as smallest_region,
)
from .intervals import (
    Interval as Interval,
    difference_interval as difference_interval,
    difference_p_value as difference_p_value,
    has_width as has_width,
    mean_interval as mean_interval,
    median_interval as median_interval,
)
from .means import masked_mean as masked_mean
from .metrics import (
    centre_error as centre_error,
    has_truth as has_truth,
    iou as iou,
    mean_precision as mean_precision,
    mean_recall as mean_recall,
    precision as precision,
    recall as recall,
    recovery as recovery,
    recovery_rate as recovery_rate,
    success as success,
    success_rate as success_rate,
    summarise as summarise,
    track_state as track_state,
)
from .particle_sets import (
    corner_distances as corner_distances,
    distinct_share as distinct_share,
    effective_dynamics as effective_dynamics,
    effective_sample_size as effective_sample_size,
    pose_variance as pose_variance,
    resamplings_per_frame as resamplings_per_frame,
)
from .points import point_distances as point_distances
from .scores import (
    CENTRE_THRESHOLDS as CENTRE_THRESHOLDS,
    IOU_THRESHOLDS as IOU_THRESHOLDS,
    distance_precision as distance_precision,
    precision_curve as precision_curve,
    success_auc as success_auc,
    success_curve as success_curve,
    success_rate_50 as success_rate_50,
    tracking_scores as tracking_scores,
)
