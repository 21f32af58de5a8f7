"""Baseline trackers for comparison: common tools and published methods."""
