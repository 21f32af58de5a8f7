"""Films as cameras and programs write them: every frame is the picture that was encoded."""

import numpy as np
import pytest
from films import moving_square, write_film

from jaxpf.media import open_frames

COUNT = 5
INTERLACED = {"flags": "+ildct+ilme"}
X264 = {"crf": "10"}
SQUARE, DV = (64, 64), (720, 576)


def frames(size=(64, 48)):
    return [moving_square(number, size) for number in range(COUNT)]


# Codec, pixel format, file suffix, options, size.
FILMS = [
    ("libx264", "yuv420p", "mp4", X264, (64, 48)),
    ("libx264", "yuv420p", "avi", X264, (64, 48)),
    ("libx264", "yuv420p", "h264", X264, (64, 48)),
    ("libx264", "yuv420p", "mkv", {**X264, "x264-params": "tff=1"}, (64, 48)),
    ("libx264", "yuv422p10le", "mov", {**X264, "x264-params": "bff=1"}, (64, 48)),
    ("libx264", "yuv420p10le", "mp4", X264, (64, 48)),
    ("libx264", "yuvj444p", "flv", X264, (64, 48)),
    ("libx264", "gray", "mkv", X264, (64, 48)),
    ("libx264", "yuv420p", "mts", {**X264, "x264-params": "tff=1"}, (64, 48)),
    ("libx265", "yuv420p", "mp4", {"crf": "10", "x265-params": "log-level=none"}, SQUARE),
    ("libx265", "yuv420p10le", "mkv", {"crf": "10", "x265-params": "log-level=none"}, SQUARE),
    ("libsvtav1", "yuv420p", "mp4", {"crf": "10"}, SQUARE),
    ("libsvtav1", "yuv420p10le", "webm", {"crf": "10"}, SQUARE),
    ("libvpx", "yuv420p", "webm", {"crf": "4", "b": "2M"}, (64, 48)),
    ("libvpx-vp9", "yuv420p", "mkv", {"crf": "10"}, (64, 48)),
    ("libvpx-vp9", "yuva420p", "webm", {"crf": "10"}, (64, 48)),
    ("mpeg2video", "yuv420p", "mpg", {"b": "5M"}, (64, 48)),
    ("mpeg2video", "yuv420p", "ts", {"b": "5M", **INTERLACED}, (64, 48)),
    ("mpeg2video", "yuv422p", "mxf", {"b": "5M", **INTERLACED}, (64, 48)),
    ("mpeg4", "yuv420p", "avi", {"b": "5M", **INTERLACED}, (64, 48)),
    ("mpeg4", "yuv420p", "mp4", {"b": "5M"}, (64, 48)),
    ("dvvideo", "yuv420p", "dv", {}, DV),
    ("dvvideo", "yuv420p", "avi", {}, DV),
    ("prores_ks", "yuv422p10le", "mov", INTERLACED, (64, 48)),
    ("mjpeg", "yuvj420p", "avi", {"q": "2"}, (64, 48)),
    ("mjpeg", "yuvj420p", "mjpeg", {"q": "2"}, (64, 48)),
    ("mjpeg", "yuvj422p", "mov", {"q": "2"}, (64, 48)),
    ("wmv2", "yuv420p", "wmv", {"b": "5M"}, (64, 48)),
    ("ffv1", "bgr0", "mkv", {}, (64, 48)),
    ("ffv1", "yuv420p10le", "avi", {}, (64, 48)),
    ("ffv1", "gray16le", "mkv", {}, (64, 48)),
    ("huffyuv", "rgb24", "avi", {}, (64, 48)),
    ("png", "rgba", "mov", {}, (64, 48)),
    ("rawvideo", "bgr24", "avi", {}, (64, 48)),
    ("wrapped_avframe", "yuv420p", "y4m", {}, (64, 48)),
    ("gif", "rgb8", "gif", {}, (64, 48)),
]


def test_frames_are_counted_where_the_header_counts_none(tmp_path):
    """A browser's recording; the film is decoded once, unless the number need not be exact."""
    path = tmp_path / "live.webm"
    write_film(path, frames(), "libvpx", "yuv420p", {}, container_options={"live": "1"})
    source = open_frames(path)
    assert source.frames_expected is None
    assert source.count_frames() == source.num_frames == COUNT


@pytest.mark.parametrize(("codec", "pixels", "suffix", "options", "size"), FILMS)
def test_every_frame_is_the_picture_that_was_encoded(
    tmp_path, monkeypatch, codec, pixels, suffix, options, size
):
    monkeypatch.setenv("SVT_LOG", "0")
    written = frames(size)
    path = write_film(tmp_path / f"film.{suffix}", written, codec, pixels, options)
    source = open_frames(path)
    assert source.count_frames() == COUNT
    read = list(source)
    assert len(read) == COUNT
    assert not source.truncated
    assert source.fps == pytest.approx(25, rel=0.01)
    times = [source.shown_at(number) for number in range(COUNT)]
    np.testing.assert_allclose(times, np.arange(COUNT) / 25, atol=0.002)
    if "gray" in pixels:
        weights = np.array([0.299, 0.587, 0.114])
        written = [np.repeat((frame @ weights)[..., None], 3, axis=-1) for frame in written]
    for frame, expected in zip(read, written, strict=True):
        error = np.abs(frame.astype(float) - expected)
        lossless = codec in ("huffyuv", "png") or pixels in ("bgr0", "bgr24")
        assert error.mean() < (1e-9 if lossless else 20 if suffix == "gif" else 8)
    different = {frame.tobytes() for frame in read}
    assert len(different) == COUNT
