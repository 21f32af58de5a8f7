"""The cost of everything that matters, each beside a baseline measured in the same minute.

The unit is nanoseconds per particle, partition and frame, compilation excluded.  Baseline and
candidate are timed alternately and the median of their ratios is reported: on a shared machine
ratios can be trusted, figures hardly.
"""
