"""Reproduction of published experiments: published and measured figures, and judged claims.

``paper`` and ``study`` are the framework shared by all papers, ``judging`` judges claims and
computes intervals, ``checkpoints`` stores measurements.  Each paper has a folder with the same
files, see ``paper``.
"""

#: Papers that can be repeated; each is a folder here.
PAPERS = ("smith2004", "gonzales2011", "rowe2005", "eskil2014", "maccormick1999")
