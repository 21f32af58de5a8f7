"""Measuring what the papers measure, in pieces that are kept."""
