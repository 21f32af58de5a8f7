"""The papers' experiments repeated: published figures beside ours, and claims judged.

``paper`` is the frame that all papers share, ``judging`` judges claims and gives figures their
intervals, ``measuring`` keeps what was measured.  Each paper has a folder with the same files.
"""
