from .calls import (
    as_seen as as_seen,
    at_frame as at_frame,
    changed_inside as changed_inside,
    check_uncoupled as check_uncoupled,
    first_motion as first_motion,
    frame_of as frame_of,
    handles_nan as handles_nan,
    has_log_density as has_log_density,
    has_log_joint as has_log_joint,
    has_log_label as has_log_label,
    has_log_odds as has_log_odds,
    has_prediction as has_prediction,
    is_coupled as is_coupled,
    log_density_all as log_density_all,
    log_first_stage_all as log_first_stage_all,
    log_joint_all as log_joint_all,
    log_label as log_label,
    log_odds_all as log_odds_all,
    log_prob_all as log_prob_all,
    method_of as method_of,
    model_error as model_error,
    moments as moments,
    observed_apart as observed_apart,
    of_frame as of_frame,
    of_partition as of_partition,
    predict_all as predict_all,
    propagate_all as propagate_all,
    propagate_label_all as propagate_label_all,
    proposal_log_density_all as proposal_log_density_all,
    proposal_of as proposal_of,
    propose_all as propose_all,
    states as states,
    time_of as time_of,
    with_inputs as with_inputs,
)
from .errors import InputError as InputError, check_known as check_known
from .interface import (
    CoupledDynamics as CoupledDynamics,
    Dynamics as Dynamics,
    DynamicsWithDensity as DynamicsWithDensity,
    DynamicsWithPrediction as DynamicsWithPrediction,
    Likelihood as Likelihood,
    Proposal as Proposal,
    Tracker as Tracker,
)
from .model import Model as Model
from .near import (
    look_near as look_near,
    observe_nearby as observe_nearby,
)
from .optional import (
    OPTIONAL as OPTIONAL,
    filter_of as filter_of,
    likelihood_of as likelihood_of,
    optional as optional,
)
from .options import Option as Option
from .pytree import (
    as_array as as_array,
    is_concrete as is_concrete,
    pytree_dataclass as pytree_dataclass,
    static_field as static_field,
)
from .refusals import Bias as Bias, evidence_biases as evidence_biases
from .state import (
    STATUS_IMPOSSIBLE as STATUS_IMPOSSIBLE,
    STATUS_INVALID_LIKELIHOOD as STATUS_INVALID_LIKELIHOOD,
    STATUS_OK as STATUS_OK,
    STATUS_UNSUPPORTED as STATUS_UNSUPPORTED,
    STATUS_WITHOUT_LIKELIHOOD as STATUS_WITHOUT_LIKELIHOOD,
    ParticleState as ParticleState,
    Summary as Summary,
)
from .wrapped import (
    SUBSTATES as SUBSTATES,
    WrappedLikelihood as WrappedLikelihood,
    WrappedTracker as WrappedTracker,
    offered as offered,
)
