"""Run any tracker over the frames of a sequence.

All loops over frames use ``frame_step``: a single run, many runs (``blocks``), streamed video
frames, and differentiated objectives.  ``missing_frames`` skips missing frames.
"""

from jaxpf._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
