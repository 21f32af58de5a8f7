from .components import components_of_sizes as components_of_sizes
from .schemes import SCHEMES as SCHEMES
from .weighted import ancestors as ancestors, weighted_resample as weighted_resample
