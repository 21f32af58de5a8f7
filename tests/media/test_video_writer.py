import os
import subprocess
import sys

import cv2
import numpy as np
import pytest

from jaxpf.errors import InputError
from jaxpf.media.video import VideoWriter, open_frames


def numbered_frame(index, width=64, height=48):
    """A frame whose left part is red and whose grey background codes its number."""
    frame = np.full((height, width, 3), 10 + 6 * index, np.uint8)
    frame[:, : width // 4] = (220, 30, 30)
    return frame


def number_of(frame):
    # Decoded grey is 2 to 4 levels too dark: OpenCV's conversion from YUV rounds down.
    return round((float(frame[10:-10, 30:-10].mean()) + 2 - 10) / 6)


def message_of(call, *arguments):
    with pytest.raises(InputError) as caught:
        call(*arguments)
    message = str(caught.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize("codec", ["vp9", "vp8"])
@pytest.mark.parametrize(("width", "height"), [(64, 48), (65, 47)])
def test_a_written_video_plays_back(tmp_path, codec, width, height):
    path = tmp_path / "out.webm"
    with VideoWriter(path, width, height, 12.5, codec) as writer:
        for index in range(12):
            writer.write(numbered_frame(index, width, height))
        assert not path.exists()
    assert writer.codec == codec
    assert os.listdir(tmp_path) == ["out.webm"]
    source = open_frames(path)
    assert (source.width, source.height, source.fps) == (
        width + width % 2,
        height + height % 2,
        12.5,
    )
    frames = list(source)
    assert [number_of(frame) for frame in frames] == list(range(12))
    assert frames[11][-1, 0, 0] > 180, "the last row repeats the one above it"
    assert abs(int(frames[11][10, -1, 0]) - 76) < 12, "so does the last column"


def test_an_interrupted_writer_leaves_a_playable_video(tmp_path):
    path = tmp_path / "out.webm"

    def write_until_interrupted():
        with VideoWriter(path, 64, 48, 25) as writer:
            for index in range(40):
                if index == 15:
                    raise KeyboardInterrupt
                writer.write(numbered_frame(index))

    with pytest.raises(KeyboardInterrupt):
        write_until_interrupted()
    assert os.listdir(tmp_path) == ["out.webm"]
    assert [number_of(frame) for frame in open_frames(path)] == list(range(15))


class Encoder:
    """OpenCV's, to be changed."""

    opencv, fourcc = cv2.VideoWriter, cv2.VideoWriter.fourcc

    def __init__(self, *arguments):
        self.encoder = self.opencv(*arguments)

    def isOpened(self):
        return self.encoder.isOpened()

    def write(self, frame):
        self.encoder.write(frame)

    def release(self):
        self.encoder.release()


def test_a_second_interrupt_while_closing_still_leaves_the_video(tmp_path, monkeypatch):
    path = tmp_path / "out.webm"

    class Interrupted(Encoder):
        def release(self):
            super().release()
            raise KeyboardInterrupt

    monkeypatch.setattr(cv2, "VideoWriter", Interrupted)
    writer = VideoWriter(path, 64, 48, 25, "vp8")
    writer.write(numbered_frame(3))
    with pytest.raises(KeyboardInterrupt):
        writer.close()
    assert [number_of(frame) for frame in open_frames(path)] == [3]


def test_a_writer_without_frames_leaves_nothing_and_closes_twice(tmp_path):
    with VideoWriter(tmp_path / "out.webm", 64, 48, 25) as writer:
        pass
    writer.close()
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
def test_a_full_disk_is_reported(tmp_path):
    program = (
        "import resource, numpy as np; from jaxpf.media.video import VideoWriter\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "rng = np.random.default_rng(0)\n"
        "with VideoWriter('out.webm', 64, 48, 25, 'vp8') as writer:\n"
        "    for _ in range(60): writer.write(rng.integers(0, 255, (48, 64, 3)).astype(np.uint8))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert "InputError: video 'out.webm' is incomplete" in done.stderr
    assert "check the free disk space" in done.stderr


def test_unusable_outputs_are_refused_with_a_remedy(tmp_path):
    assert "must end in .webm" in message_of(VideoWriter, tmp_path / "out.mp4", 64, 48, 25)
    message = message_of(VideoWriter, tmp_path / "gone" / "out.webm", 64, 48, 25)
    assert f"cannot write '{tmp_path / 'gone' / 'out.webm'}'" in message
    assert "no such file or directory" in message
    assert "fps nan" in message_of(VideoWriter, tmp_path / "o.webm", 64, 48, float("nan"))


def test_the_other_codec_is_taken_when_the_asked_one_is_missing(tmp_path, monkeypatch):
    missing = {"VP90"}

    class Poor(Encoder):
        def __init__(self, path, api, fourcc, *arguments):
            self.is_there = fourcc not in {self.fourcc(*name) for name in missing}
            super().__init__(path, api, fourcc, *arguments)

        def isOpened(self):
            return self.is_there and super().isOpened()

    monkeypatch.setattr(cv2, "VideoWriter", Poor)
    with VideoWriter(tmp_path / "out.webm", 64, 48, 25) as writer:
        writer.write(numbered_frame(1))
    assert writer.codec == "vp8"
    missing.add("VP80")
    message = message_of(VideoWriter, tmp_path / "none.webm", 64, 48, 25)
    assert "neither the VP9 nor the VP8 encoder" in message
    assert os.listdir(tmp_path) == ["out.webm"]


def test_frames_of_another_shape_or_type_are_refused(tmp_path):
    with VideoWriter(tmp_path / "out.webm", 64, 48, 25) as writer:
        for frame in (np.zeros((64, 48, 3), np.uint8), np.zeros((48, 64, 3))):
            with pytest.raises(ValueError, match="expected a uint8 frame"):
                writer.write(frame)
