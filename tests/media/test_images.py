"""Folders of images as videos."""

import cv2
import numpy as np
import pytest
from numbered_frames import number_of, numbered_frame
from refusals import message_of

from jaxpf.media import open_frames
from jaxpf.media.images import natural_order


def write_images(folder, *names, value=7, dtype=np.uint8):
    for name in names:
        cv2.imwrite(str(folder / name), np.full((12, 16, 3), value, dtype))


def test_a_folder_gives_its_images_in_natural_order(tmp_path):
    for index in range(7, 13):
        cv2.imwrite(str(tmp_path / f"img{index}.png"), numbered_frame(index)[..., ::-1])
    (tmp_path / "notes.txt").write_text("not a frame")
    (tmp_path / "._img3.png").write_bytes(b"left by a file system")
    source = open_frames(tmp_path)
    assert (source.name, source.num_frames, source.fps) == (tmp_path.name, 6, 25.0)
    assert [number_of(frame) for frame in source] == [7, 8, 9, 10, 11, 12]
    assert [number_of(frame) for frame in source.frames(4)] == [11, 12]
    np.testing.assert_array_equal(next(iter(source)), numbered_frame(7))
    assert "frame 6" in message_of(source.frames, 6)


def test_natural_order_compares_numbers_as_numbers():
    names = ["b1", "a10", "a2", "10", "9", "a2b", "A3"]
    assert sorted(names, key=natural_order) == ["9", "10", "a2", "a2b", "A3", "a10", "b1"]


@pytest.mark.parametrize("suffix", ["png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp", "PNG"])
def test_every_listed_format_is_read(tmp_path, suffix):
    cv2.imwrite(str(tmp_path / f"0.{suffix}"), numbered_frame(7)[..., ::-1])
    source = open_frames(tmp_path)
    assert number_of(next(iter(source))) == 7
    assert "holds one image only" in source.note


def test_grey_alpha_and_16_bits_become_rgb(tmp_path):
    grey = np.full((8, 10), 77, np.uint8)
    alpha = np.dstack([np.full((8, 10), value, np.uint8) for value in (10, 20, 30, 0)])
    deep = np.zeros((8, 10, 3), np.uint16)
    deep[..., 2], deep[..., 1] = 65535, 32896  # BGR
    deep_grey = np.full((8, 10), 25700, np.uint16)
    for index, image in enumerate((grey, alpha, deep, deep_grey)):
        cv2.imwrite(str(tmp_path / f"{index}.png"), image)
    pixels = [frame[0, 0].tolist() for frame in open_frames(tmp_path)]
    assert pixels == [[77, 77, 77], [30, 20, 10], [255, 128, 0], [100, 100, 100]]


@pytest.mark.parametrize(
    ("numbers", "remark"),
    [
        ((0, 5, 10), "in steps of 5; they count as 0, 1, 2, ..."),
        ((7, 8, 9), "numbered from 7 on; they count as 0, 1, 2, ..."),
        (range(10**30, 10**30 + 3), "on; they count as 0, 1, 2, ..."),
        ((1, 2, "cover"), "'cover.png' in folder"),
        ((0, 1, 2), None),
        ((1, 2, 3), None),
    ],
)
def test_frames_that_count_from_elsewhere_or_in_steps_are_taken_with_a_remark(
    tmp_path, numbers, remark
):
    write_images(tmp_path, *(f"{number}.png" for number in numbers))
    note = open_frames(tmp_path).note
    assert note is None if remark is None else remark in note


def test_12_bits_in_images_of_16_are_scaled_by_their_range(tmp_path):
    image = np.full((12, 16, 4), 2048, np.uint16)
    image[..., 3] = 65535  # full alpha does not hide that there are 12 bits
    cv2.imwrite(str(tmp_path / "0.png"), image)
    source = open_frames(tmp_path)
    assert "count as 12" in source.note
    assert next(iter(source))[0, 0].tolist() == [128, 128, 128]


def test_one_dark_image_does_not_make_a_folder_12_bit(tmp_path):
    for number, value in enumerate((3000, 60_000, 30_000)):
        write_images(tmp_path, f"{number}.png", value=value, dtype=np.uint16)
    levels = [int(frame[0, 0, 0]) for frame in open_frames(tmp_path)]
    assert levels == [round(value / 257) for value in (3000, 60_000, 30_000)]


def test_an_image_that_contradicts_12_bits_is_refused(tmp_path):
    names = [f"{number}.png" for number in range(20)]
    write_images(tmp_path, *names, value=3000, dtype=np.uint16)
    write_images(tmp_path, "1.png", value=4096, dtype=np.uint16)  # is not sampled
    frames = open_frames(tmp_path).frames()
    next(frames)
    assert f"'{tmp_path / '1.png'}' has a value of 4096" in message_of(next, frames)
    chosen = open_frames(tmp_path, range=(0, 65535))
    assert [int(frame[0, 0, 0]) for frame in chosen][:3] == [12, 16, 12]


TEXTURE = np.random.default_rng(0).integers(0, 256, (48, 64), np.uint16)
TEXTURE[20:28, 20:28] = np.arange(0, 256, 4).reshape(8, 8)  # flat enough for a median


@pytest.mark.parametrize("defect", [None, 0, 4000, 65535])
@pytest.mark.parametrize(
    ("values", "black", "white"),
    [
        (TEXTURE, 0, 255),  # 8 bits in 16
        (7000 + 6 * TEXTURE, 7000, 8530),  # thermal
        (100 + TEXTURE // 8, 100, 131),  # a dim microscope
        (200 + 3 * TEXTURE, 200, 965),  # the same, of 12 bits
    ],
)
def test_images_that_fill_little_of_16_bits_are_scaled_by_their_content(
    tmp_path, values, black, white, defect
):
    for number in range(3):
        image = values.copy()
        if defect is not None:
            image[10 * number, 5] = defect  # a pixel of the sensor
        cv2.imwrite(str(tmp_path / f"{number}.tif"), image)
    source = open_frames(tmp_path)
    frames = np.stack(list(source))
    assert len(np.unique(frames)) >= min(64, 0.8 * (white - black))  # a quarter of all levels
    assert source.note is not None
    exact = list(open_frames(tmp_path, range=(black, white)))[1][30:, :, 0]
    np.testing.assert_allclose(exact, (values[30:] - black) / (white - black) * 255, atol=0.51)
