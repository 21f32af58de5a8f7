"""Folders of images as videos."""

import os
import struct
import zlib

import cv2
import numpy as np
import pytest
from numbered_frames import number_of, numbered_frame
from refusals import message_of

from jaxpf import InputError
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


def test_floating_point_images_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "0.tif"), np.ones((8, 10, 3), np.float32))
    message = message_of(open_frames, tmp_path)
    assert "0.tif" in message
    assert "float32" in message
    assert "convert it to 8 or 16 bits" in message
    cv2.imwrite(str(tmp_path / "0.tif"), np.ones((8, 10), np.float32))
    assert "32 bits per channel" in message_of(open_frames, tmp_path)


def test_mixed_sizes_are_refused_naming_both(tmp_path):
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((48, 64, 3), np.uint8))
    cv2.imwrite(str(tmp_path / "1.png"), np.zeros((24, 32, 3), np.uint8))
    message = message_of(list, open_frames(tmp_path))
    assert "'0.png' is 64x48 but '1.png' is 32x24" in message
    assert str(tmp_path) in message
    assert "keep only frames of one size" in message


@pytest.mark.parametrize(("content", "state"), [(b"", "empty (0 bytes)"), (b"no image", "damaged")])
def test_an_image_that_does_not_decode_is_named(tmp_path, content, state):
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((48, 64, 3), np.uint8))
    (tmp_path / "1.png").write_bytes(content)
    message = message_of(list, open_frames(tmp_path))
    assert str(tmp_path / "1.png") in message
    assert state in message
    assert "replace or remove it" in message


def test_a_folder_without_images_is_refused_and_points_to_what_was_meant(tmp_path):
    message = message_of(open_frames, tmp_path)
    assert f"folder '{tmp_path}' holds no images" in message
    assert "png" in message
    (tmp_path / "video.mp4").touch()
    assert f"did you mean '{tmp_path / 'video.mp4'}'" in message_of(open_frames, tmp_path)
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "0.png").touch()
    assert f"did you mean '{tmp_path / 'frames'}'" in message_of(open_frames, tmp_path)
    cv2.imwrite(str(tmp_path / "preview.png"), np.zeros((48, 64, 3), np.uint8))
    message = message_of(open_frames, tmp_path)
    assert f"one image only, 'preview.png'; did you mean '{tmp_path / 'frames'}'" in message


def test_a_folder_that_leaves_numbers_out_is_refused(tmp_path):
    write_images(tmp_path, "f1.png", "f2.png", "f3.png", "f16.png", "f17.png")
    with pytest.raises(
        InputError, match=r"no frame 4 to 15: 'f16\.png' follows 'f3\.png'.*add the missing frames"
    ):
        open_frames(tmp_path)


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (("f1_rgb.png", "f2_rgb.png", "f9_rgb.png"), r"no frame 3 to 8: 'f9_rgb\.png' follows"),
        (("1.png", "1.jpg", "2.png", "2.jpg"), r"two files of number 1, '1\.jpg' and '1\.png'"),
    ],
)
def test_numbers_are_checked_wherever_they_stand(tmp_path, names, sentence):
    write_images(tmp_path, *names)
    with pytest.raises(InputError, match=sentence):
        open_frames(tmp_path)


def test_numbers_may_have_any_size(tmp_path):
    write_images(tmp_path, *(f"{10**30 + time}.png" for time in range(3)))
    assert "on; they count as 0, 1, 2, ..." in open_frames(tmp_path).note


def test_an_image_without_a_number_among_numbered_ones_is_remarked(tmp_path):
    write_images(tmp_path, "1.png", "2.png", "cover.png")
    assert "'cover.png' in folder" in open_frames(tmp_path).note


@pytest.mark.parametrize(
    ("numbers", "remark"),
    [
        ((0, 5, 10), "in steps of 5; they count as 0, 1, 2, ..."),
        ((7, 8, 9), "numbered from 7 on; they count as 0, 1, 2, ..."),
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
    write_images(tmp_path, "0.png", "1.png", value=2048, dtype=np.uint16)
    source = open_frames(tmp_path)
    assert "count as 12" in source.note
    assert {int(frame[0, 0, 0]) for frame in source} == {128}


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


def test_a_range_is_of_images_of_16_bits(tmp_path):
    write_images(tmp_path, "0.png", "1.png")
    assert "range" in message_of(open_frames, tmp_path, range=(0, 255))
    write_images(tmp_path, "0.png", "1.png", value=2048, dtype=np.uint16)
    for wrong in ((5, 5), (9, 2), (-1, 5), (0, 65536)):
        assert "range" in message_of(open_frames, tmp_path, range=wrong)


def test_links_in_a_circle_and_images_beyond_all_limits_are_one_sentence(tmp_path):
    (tmp_path / "here").symlink_to(tmp_path / "there")
    (tmp_path / "there").symlink_to(tmp_path / "here")
    assert "there is no video or folder at" in message_of(open_frames, tmp_path / "here")
    folder = tmp_path / "frames"
    folder.mkdir()
    (folder / "0.png").symlink_to(folder / "0.png")
    assert "0.png': too many levels of symbolic links" in message_of(open_frames, folder)
    (folder / "0.png").unlink()
    header = struct.pack(">4sIIBBBBB", b"IHDR", 60_000, 60_000, 8, 2, 0, 0, 0)
    checked = struct.pack(">I", zlib.crc32(header)) + struct.pack(">I4sI", 0, b"IDAT", 0x35AF061E)
    (folder / "0.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"\0\0\0\r" + header + checked)
    assert "it is damaged, too large (2^30 pixels)" in message_of(open_frames, folder)


def test_full_alpha_does_not_hide_that_an_image_has_12_bits(tmp_path):
    image = np.full((12, 16, 4), 2048, np.uint16)
    image[..., 3] = 65535
    cv2.imwrite(str(tmp_path / "0.png"), image)
    assert next(iter(open_frames(tmp_path)))[0, 0].tolist() == [128, 128, 128]


def test_images_with_several_pictures_are_refused_with_the_way_to_split_them(tmp_path):
    pages = [np.full((12, 16, 3), level, np.uint8) for level in (0, 90, 180)]
    cv2.imwritemulti(str(tmp_path / "a.tif"), pages)
    for place in (tmp_path / "a.tif", tmp_path):
        assert "holds 3 pictures; split it" in message_of(open_frames, place)


def test_an_image_whose_name_is_not_utf_8_is_refused(tmp_path):
    write_images(tmp_path, "0.png")
    (tmp_path / "0.png").rename(tmp_path / os.fsdecode(b"\xff.png"))
    assert "is not UTF-8; rename" in message_of(open_frames, tmp_path)
