"""What is refused of films and pictures, and what the sentence must name: one row for each rule."""

import os
import struct
import sys
import zlib

import cv2
import numpy as np
import pytest
from films import moving_square, write_film
from refusals import message_of

from jaxpf.media import VideoWriter, open_frames

GREY = np.full((90, 120, 3), 128, np.uint8)
LIST = b"#EXTM3U\n#EXT-X-TARGETDURATION:4\n#EXTINF:4,\nwalk.avi\n#EXT-X-ENDLIST\n"
CONCATENATED = b"ffconcat version 1.0\nfile walk.avi\n"


def png_of(width, height):
    """The beginning of an image of that size."""
    header = struct.pack(">4sIIBBBBB", b"IHDR", width, height, 8, 2, 0, 0, 0)
    checked = struct.pack(">I", zlib.crc32(header)) + struct.pack(">I4sI", 0, b"IDAT", 0x35AF061E)
    return b"\x89PNG\r\n\x1a\n\0\0\0\r" + header + checked


@pytest.mark.parametrize(
    ("name", "content", "named"),
    [
        ("gone.mp4", None, "path"),
        ("empty.mp4", b"", "0 bytes"),
        ("boxes.txt", b"frame,id,x,y,w,h\n0,1,2,3,4,5\n" * 300, "not a video"),
        ("umlauts.csv", "größe,".encode() * 2000, "not a video"),
        ("noise.mp4", bytes(range(256)) * 20, "not a video"),
        ("frame.png", b"\x89PNG\r\n\x1a\n\x00", "single image"),
        *(
            (f"list.{suffix}", content + end, "not a video")
            for suffix in ("m3u8", "mp4", "avi")
            for content, end in ((LIST, b""), (LIST, b"\x01"), (CONCATENATED, b"\x01"))
        ),
    ],
)
def test_what_is_no_video_is_refused(tmp_path, name, content, named):
    path = tmp_path / name
    if name.startswith("list"):
        write_film(tmp_path / "walk.avi", [moving_square(0)] * 2)
    if content is not None:
        path.write_bytes(content)
    message = message_of(open_frames, path)
    assert str(path) in message
    assert named in message


def image(dtype=np.uint8, size=(12, 16), value=0, channels=3):
    return np.full((*size, channels), value, dtype)


#: Files of a folder, what is opened of it, and what must be named: images, bytes, or links to
#: themselves.
FOLDERS = [
    ({}, {}, "no images"),
    ({"0.tif": image(np.float32)}, {}, "float32"),
    ({"0.tif": image(np.float32, channels=1)}, {}, "32 bits"),
    (
        {"0.png": image(size=(48, 64)), "1.png": image(size=(24, 32))},
        {},
        "at '1.png', from 64x48 to 32x24",
    ),
    ({"0.png": image(), "1.png": b""}, {}, "0 bytes"),
    ({"0.png": image(), "1.png": b"no image"}, {}, "1.png"),
    ({f"f{n}.png": image() for n in (1, 2, 3, 16, 17)}, {}, "'f16.png' follows 'f3.png'"),
    ({f"f{n}_rgb.png": image() for n in (1, 2, 9)}, {}, "'f9_rgb.png' follows 'f2_rgb.png'"),
    (
        {f"{n}.{end}": image() for n in (1, 2) for end in ("png", "jpg")},
        {},
        "'1.png' follows '1.jpg'",
    ),
    ({"0.png": "loop"}, {}, "0.png"),
    ({"0.png": png_of(60_000, 60_000)}, {}, "2^30 pixels"),
    ({os.fsdecode(b"\xff.png"): image()}, {}, "UTF-8"),
    ({"0.png": image(), "1.png": image()}, {"range": (0, 255)}, "range"),
    *(
        ({"0.png": image(np.uint16, value=2048)}, {"range": wrong}, "range")
        for wrong in ((5, 5), (9, 2), (-1, 5), (0, 65536))
    ),
]


@pytest.mark.parametrize(("files", "options", "named"), FOLDERS)
def test_a_folder_that_is_no_film_is_refused(tmp_path, files, options, named):
    for name, content in files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif isinstance(content, str):
            path.symlink_to(path)
        else:
            cv2.imwrite(str(tmp_path / f"written{path.suffix}"), content)
            (tmp_path / f"written{path.suffix}").rename(path)
    message = message_of(lambda: list(open_frames(tmp_path, **options)))
    assert named in message
    assert str(tmp_path) in message or "range" in named


def test_images_with_several_pictures_are_refused(tmp_path):
    cv2.imwritemulti(str(tmp_path / "a.tif"), [image(value=level) for level in (0, 90, 180)])
    for place in (tmp_path / "a.tif", tmp_path):
        assert "3 pictures" in message_of(open_frames, place)


def written(path, fps=25):
    return lambda: VideoWriter(path, 64, 48, fps)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: open_frames(1000 * "long"), "too long"),
        (lambda: open_frames(""), "no video"),
        (lambda: open_frames("there"), "there"),  # a link to itself
        (written("out.avi"), ".mp4"),
        (written("gone/out.mp4"), "gone"),
        *((written("o.mp4", fps), "fps") for fps in (float("nan"), 0, 1e-9, 1e9)),
    ],
)
def test_what_cannot_be_opened_or_written_is_refused(tmp_path, monkeypatch, call, named):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").symlink_to("there")
    assert named in message_of(call)
    assert os.listdir() == ["there"]


def test_without_pyav_folders_are_read_and_films_say_what_to_install(tmp_path, monkeypatch):
    cv2.imwrite(str(tmp_path / "0.png"), GREY)
    (tmp_path / "walk.avi").write_bytes(b"RIFF" + bytes(99))
    monkeypatch.setitem(sys.modules, "av", None)
    assert "jaxpf[cli]" in message_of(open_frames, tmp_path / "walk.avi")
    assert "jaxpf[cli]" in message_of(written(tmp_path / "out.mp4"))
    (tmp_path / "walk.avi").unlink()
    assert len(list(open_frames(tmp_path))) == 1


@pytest.mark.parametrize("name", [b"\xff.avi", b"\xff"])
def test_a_name_that_is_not_utf_8_is_refused(tmp_path, name):
    place = tmp_path / os.fsdecode(name)
    if place.suffix:
        place.write_bytes(b"RIFF" + bytes(99))
    else:
        place.mkdir()
    message = message_of(open_frames, place)
    assert "\\udcff" in message
    assert "UTF-8" in message
