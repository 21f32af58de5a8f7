"""What things cost, each beside a baseline measured in the same minute: ``jaxpf bench``.

The unit is nanoseconds per particle, partition and frame, everything included but compilation.
Baseline and candidate are timed alternately and the median of their ratios is reported: on a
shared machine ratios can be trusted, figures hardly.  A benchmark is a module with a ``TITLE`` and
``rows(repeats)``.
"""

#: Modules with a ``TITLE`` and ``rows``, in the order in which they are measured.
SECTIONS = (
    "histogram",
    "contours",
    "kernel",
    "appearance",
    "turned_parts",
    "labelled",
    "generic",
    "points",
    "gradients",
)
