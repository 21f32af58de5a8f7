"""Trackers of other kinds, to compare with: what a user would take today, and published rivals."""
