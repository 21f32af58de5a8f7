"""Measures the finished runs of an evaluation, summarises them, and states the conclusion."""
