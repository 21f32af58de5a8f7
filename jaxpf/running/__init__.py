"""Running any tracker over the frames of a sequence.

There is one loop over frames, ``frame_step``.  One run, many of them (``blocks``), a video's frames
as they come and objectives that are differentiated arrange the runs as they need;
``missing_frames`` leaves out frames that are missing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
