"""Damaged films: the good frames and a note, or a refusal; nothing else."""

import pytest
from films import moving_square, write_film

from jaxpf import InputError
from jaxpf.media import open_frames

COUNT = 30
GROUPS = {"g": "6", "crf": "10"}
FRAGMENTS = {"movflags": "frag_keyframe+empty_moov"}
# File suffix, codec, options of the container.
FILMS = [
    ("mkv", "libx264", {}),
    ("ts", "libx264", {}),
    ("flv", "libx264", {}),
    ("avi", "libx264", {}),
    ("mov", "libx264", {}),
    ("mp4", "libx264", {"movflags": "faststart"}),
    ("mp4", "libx264", FRAGMENTS),
    ("webm", "libvpx-vp9", {}),
]
# Odd lengths: a transport stream that is cut between two of its packets does not show it.
DAMAGE = {
    "cut in the first tenth": lambda data: data[: len(data) // 10 | 1],
    "cut in the middle": lambda data: data[: len(data) // 2 | 1],
    "cut near the end": lambda data: data[: len(data) * 9 // 10 | 1],
    "zeros at the end": lambda data: data[: len(data) // 2].ljust(len(data), b"\0"),
    "zeros at the beginning": lambda data: bytes(64) + data[64:],
    "noise at the beginning": lambda data: bytes(range(1, 97)) + data[96:],
    "more at the end": lambda data: data + bytes(2000),
}


@pytest.mark.parametrize("film", FILMS, ids=lambda film: "-".join((film[0], *film[2].values())))
def test_a_damaged_film_gives_its_good_frames_and_says_so_or_is_refused(tmp_path, film):
    suffix, codec, container_options = film
    path = tmp_path / f"film.{suffix}"
    frames = [moving_square(number % 10) + number for number in range(COUNT)]
    write_film(path, frames, codec, options=GROUPS, container_options=container_options)
    data, good = path.read_bytes(), [frame.tobytes() for frame in open_frames(path)]
    assert len(set(good)) == COUNT
    assert open_frames(path).note is None
    for what, damage in DAMAGE.items():
        path.write_bytes(damage(data))
        try:
            source = open_frames(path)
            read = [frame.tobytes() for frame in source]
        except InputError:
            continue
        same = sum(one == other for one, other in zip(read, good, strict=False))
        assert same >= len(read) - 2, what  # those at the cut may lack what they refer to
        announces = suffix != "ts"
        assert source.note or read == (good if announces else good[: len(read)]), what


def test_a_title_that_is_not_utf_8_does_no_harm(tmp_path):
    path = tmp_path / "film.avi"

    def name(stream):
        stream.container.metadata["title"] = "Uebung"

    write_film(
        path, [moving_square(number) for number in range(3)], "mjpeg", "yuvj420p", prepare=name
    )
    path.write_bytes(path.read_bytes().replace(b"Uebung", "Übung1".encode("latin-1")))
    assert len(list(open_frames(path))) == 3
