from .factored.drift import Motion as Motion, correlations as correlations
from .labelled.population import add_target as add_target, remove_target as remove_target
from .registry import Filter as Filter, build as build, filter_of as filter_of, register as register
from .uncertainty.error_bars import WithErrorBars as WithErrorBars
from .uncertainty.quantiles import quantiles as quantiles
from .uncertainty.side_by_side import SideBySide as SideBySide
