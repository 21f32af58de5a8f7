"""Writes tables, figures and the report of an evaluation."""
