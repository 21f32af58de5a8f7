"""Run any tracker over the frames of a sequence.

All loops over frames use ``frame_step``: a single run, many runs (``blocks``), streamed video
frames, and differentiated objectives.  ``missing_frames`` skips missing frames.
"""
