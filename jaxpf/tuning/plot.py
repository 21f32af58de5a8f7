"""Plot traces of loss, gradient norm and parameters."""

from typing import TYPE_CHECKING

import numpy as np

from jaxpf.media.plotting import colours, new_figure
from jaxpf.tuning.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def traces(result: Result, loss_name: str = "loss") -> "Figure":
    """Plot loss, gradient norm and every parameter over the steps, one line per repeat.

    A dashed line marks the tuned value, with its 95% interval if known.
    """
    columns = []
    for parameter in result.parameters:
        shape = np.shape(result.free[parameter.path])
        columns += [(parameter, index) for index in np.ndindex(shape)]
    columns = columns[:8]
    rows = 2 + len(columns)
    figure, axes = new_figure(
        (rows + 1) // 2, 2, figsize=(11, 2.6 * ((rows + 1) // 2)), share_x=True
    )
    axes = axes.ravel()
    lines = colours(len(result.descents))
    for descent, colour in zip(result.descents, lines, strict=True):
        steps = np.arange(1, descent.num_steps + 1)
        axes[0].plot(steps, descent.loss, color=colour, label=f"repeat {descent.repeat + 1}")
        axes[1].plot(steps, descent.gradient_norm, color=colour)
    axes[0].set(ylabel=loss_name)
    axes[0].legend(fontsize="small")
    axes[1].set(ylabel="norm of the gradient")
    if all((descent.gradient_norm > 0).all() for descent in result.descents):
        axes[1].set_yscale("log")
    values, intervals = result.values, result.intervals()
    for axis, (parameter, index) in zip(axes[2:], columns, strict=False):
        for descent, colour in zip(result.descents, lines, strict=True):
            trace = np.asarray(parameter.to_value(descent.free[parameter.path]))
            axis.plot(np.arange(len(trace)), trace[(slice(None), *index)], color=colour)
        low, high = (float(end[index]) for end in intervals[parameter.path])
        if high > low:
            axis.axhspan(low, high, color="black", alpha=0.12, label="95% interval")
        axis.axhline(
            float(values[parameter.path][index]), color="black", ls="--", label="value found"
        )
        if parameter.low == 0 and np.isinf(parameter.high):
            axis.set_yscale("log")
        suffix = "".join(f"[{i}]" for i in index)
        axis.set(ylabel=f"{parameter.path}{suffix}")
    if rows > 2:
        axes[2].legend(fontsize="small")
    for axis in axes[rows:]:
        axis.set_visible(False)
    for axis in axes[max(0, rows - 2) : rows]:
        axis.set(xlabel="step")
        axis.tick_params(labelbottom=True)
    for axis in axes:
        axis.grid(alpha=0.3)
    if not result.settled:
        figure.suptitle("not settled: the intervals leave out how far the values would have moved")
    return figure
