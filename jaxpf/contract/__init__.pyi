from .calls import (
    log_density_all as log_density_all,
    log_prob_all as log_prob_all,
    propagate_all as propagate_all,
)
from .interface import (
    CoupledDynamics as CoupledDynamics,
    Dynamics as Dynamics,
    DynamicsWithDensity as DynamicsWithDensity,
    DynamicsWithPrediction as DynamicsWithPrediction,
    Likelihood as Likelihood,
    Proposal as Proposal,
    Tracker as Tracker,
)
from .options import Option as Option
from .pytree import static_field as static_field
from .refusals import Bias as Bias, evidence_biases as evidence_biases
from .state import (
    STATUS_IMPOSSIBLE as STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD as STATUS_INVALID_LIKELIHOOD,
    STATUS_OK as STATUS_OK,
    STATUS_UNSUPPORTED as STATUS_UNSUPPORTED,
    STATUS_WITHOUT_LIKELIHOOD as STATUS_WITHOUT_LIKELIHOOD,
)
from .wrapped import WrappedLikelihood as WrappedLikelihood, WrappedTracker as WrappedTracker
