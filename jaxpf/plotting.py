"""Figures."""

from jaxpf.media.plotting import bars_with_intervals, colours, diagnostics, new_figure, save_figure

__all__ = ["bars_with_intervals", "colours", "diagnostics", "new_figure", "save_figure"]
