"""Frames into a video file."""

from jaxpf.media.video_writer import SUFFIXES, VideoWriter

__all__ = ["SUFFIXES", "VideoWriter"]
