"""Reproduction of published experiments: published and measured figures, and judged claims.

``paper`` is the framework shared by all papers, ``judging`` judges claims and computes intervals,
``checkpoints`` stores measurements.  Each paper has a folder with the same files.
"""
