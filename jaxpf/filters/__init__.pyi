from .factored.drift import Motion as Motion, correlations as correlations
from .labelled.population import add_target as add_target, remove_target as remove_target
from .labelled.state import LabelledState as LabelledState
from .registry import (
    Filter as Filter,
    Variant as Variant,
    all_filters as all_filters,
    build as build,
    filter_of as filter_of,
    methods as methods,
    register as register,
)
from .uncertainty.error_bars import ErrorBars as ErrorBars, WithErrorBars as WithErrorBars
from .uncertainty.quantiles import quantiles as quantiles
from .uncertainty.side_by_side import SideBySide as SideBySide
