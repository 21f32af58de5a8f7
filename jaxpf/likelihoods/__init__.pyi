from .contours import (
    EdgeDetector as EdgeDetector,
    Features as Features,
    contours as contours,
    detection_probabilities as detection_probabilities,
    line_weights as line_weights,
    log_ratio as log_ratio,
    poisson_clutter as poisson_clutter,
)
from .discriminative import discriminative as discriminative
from .distance_law import log_normaliser as log_normaliser, log_tilt as log_tilt
from .gaussian import Gaussian as Gaussian, kalman as kalman, stacked_model as stacked_model
from .histogram import histogram as histogram, histogram_from_patches as histogram_from_patches
from .patch import patch as patch, windows as windows
from .pixels import pixels as pixels
from .pretrained import pretrained as pretrained, pretrained_points as pretrained_points
