from .components import (
    Components as Components,
    component_cdf as component_cdf,
    components_of_sizes as components_of_sizes,
    few_effective as few_effective,
    one_component as one_component,
)
from .schemes import SCHEMES as SCHEMES
from .weighted import (
    ancestors as ancestors,
    renormalised as renormalised,
    soft_selection as soft_selection,
    weighted_resample as weighted_resample,
)
