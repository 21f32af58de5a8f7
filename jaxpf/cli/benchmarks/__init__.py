"""Benchmarks, each with a baseline measured at the same time.

Times are in nanoseconds per particle, partition and frame, without compilation.  Baseline and
candidate are timed alternately and the median of their ratios is reported: on a shared machine
ratios are reliable, absolute times are not.
"""
