from .overlay import (
    draw_boxes as draw_boxes,
    draw_outlines as draw_outlines,
    draw_particles as draw_particles,
    object_colours as object_colours,
)
from .page.notebook import mark as mark, view as view
from .plotting import colours as colours
from .read import open_frames as open_frames
from .video_writer import VideoWriter as VideoWriter
