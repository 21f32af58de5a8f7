from .color import NUM_BINS as NUM_BINS, hsv_bins as hsv_bins
from .contours import (
    EdgeDetector as EdgeDetector,
    ExclusiveContours as ExclusiveContours,
    Features as Features,
    IndependentContours as IndependentContours,
    Lines as Lines,
    OpaqueContours as OpaqueContours,
    contours as contours,
    detection_probabilities as detection_probabilities,
    learn_clutter as learn_clutter,
    line_weights as line_weights,
    log_ratio as log_ratio,
    lost_tail as lost_tail,
    poisson_clutter as poisson_clutter,
)
from .detected import Detected as Detected
from .discriminative import (
    DiscriminativeLikelihood as DiscriminativeLikelihood,
    discriminative as discriminative,
)
from .distance_law import (
    learn_background as learn_background,
    log_density as log_density,
    log_normaliser as log_normaliser,
    log_tilt as log_tilt,
)
from .exclusion import (
    ExclusiveAppearance as ExclusiveAppearance,
    ExclusivePretrained as ExclusivePretrained,
    excluding as excluding,
)
from .gaussian import (
    Gaussian as Gaussian,
    kalman as kalman,
    stacked_model as stacked_model,
)
from .histogram import (
    HistogramLikelihood as HistogramLikelihood,
    histogram as histogram,
    histogram_from_patches as histogram_from_patches,
)
from .open_histogram import open_histogram as open_histogram, with_object as with_object
from .patch import (
    PatchLikelihood as PatchLikelihood,
    patch as patch,
    patch_from_pictures as patch_from_pictures,
    windows as windows,
    windows_from_pictures as windows_from_pictures,
)
from .pixels import PixelLikelihood as PixelLikelihood, pixels as pixels
from .pretrained import (
    EfficientNetLite0 as EfficientNetLite0,
    PretrainedLikelihood as PretrainedLikelihood,
    PretrainedPoints as PretrainedPoints,
    efficientnet_lite0 as efficientnet_lite0,
    pretrained as pretrained,
    pretrained_points as pretrained_points,
)
