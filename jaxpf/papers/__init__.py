"""The papers' experiments repeated: published figures beside ours, and claims judged.

``paper`` is the frame that all share; ``claims`` and ``estimates`` are how claims are judged and
figures get their intervals; ``parts`` keeps what was measured.  Each paper has a folder with
``published``, ``scenes``, ``measure``, ``tables``, ``claims`` and ``figures``.
"""
