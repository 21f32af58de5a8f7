"""Frames of a video, a folder of pictures, a camera or a stream."""

from jaxpf.media.video import open_frames

__all__ = ["open_frames"]
