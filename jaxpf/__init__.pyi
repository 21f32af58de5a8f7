from . import (
    boxes as boxes,
    contours as contours,
    contract as contract,
    detections as detections,
    dynamics as dynamics,
    evaluation as evaluation,
    filters as filters,
    gradients as gradients,
    likelihoods as likelihoods,
    measures as measures,
    media as media,
    ordering as ordering,
    parts as parts,
    points as points,
    proposals as proposals,
    resampling as resampling,
    sequences as sequences,
    shapes as shapes,
    smoothing as smoothing,
    targets as targets,
    tuning as tuning,
)
from .contract.errors import InputError as InputError
from .contract.logs import log_evidence as log_evidence
from .contract.pytree import pytree_dataclass as pytree_dataclass
from .contract.state import ParticleState as ParticleState, Summary as Summary
from .files.states import load as load, save as save
from .filters.factored.eskil import Eskil as Eskil
from .filters.factored.pffl import PFFL as PFFL
from .filters.functions import state_space as state_space
from .filters.labelled.tracker import Labelled as Labelled
from .filters.partitioned.tracker import Partitioned as Partitioned
from .running.blocks import monte_carlo as monte_carlo
from .running.cores import use_cores as use_cores
from .running.runs import forecast as forecast, run as run, stream as stream
from .running.simulation import simulate as simulate
from .smoothing.smoother import smooth as smooth
from .tuning.loop import tune as tune
from .tuning.metropolis import pmmh as pmmh

__version__: str
