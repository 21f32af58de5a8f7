"""Two boxes through a video, as ``jaxpf track`` follows them, drawn on its frames."""

import jax

import jaxpf

source = jaxpf.media.open_frames("clip.mp4")
frames = source.frames()
tracker = jaxpf.boxes.tracker(next(frames), [[120, 80, 40, 90], [300, 85, 42, 88]])
with jaxpf.media.VideoWriter("out.mp4", source.width, source.height, source.fps) as video:
    for tracked in jaxpf.stream(tracker, jax.random.key(0), frames):
        boxes = jaxpf.boxes.to_boxes(tracker, tracked.summary.estimate)
        video.write(jaxpf.media.draw_boxes(tracked.frame, boxes))
