"""How much another run would differ: error bars of a filter's answers, from a single run."""

from jaxpf.filters.error_bars import ErrorBars, WithErrorBars

__all__ = ["ErrorBars", "WithErrorBars"]
