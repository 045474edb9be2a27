"""Maps of nav2_map_server: every mode of shades, and where the map lies."""

import numpy as np
import pytest

from serd_app.errors import AppError
from serd_app.places.free_area import free_area_m
from serd_app.places.ros_map import read_map
from serd_bag.errors import FileError
from support.ros_maps import FREE, OCCUPIED, UNKNOWN, write_map

#: Black, dark, middle, bright, white: p = 1, 0.75, 0.498, 0.2, 0.
SHADES = np.array([[0, 64, 128, 204, 255]], dtype=np.uint8)


TWO = np.array([[UNKNOWN, FREE]], dtype=np.uint8)
#: White, and white that is transparent: the opacity is averaged in, as nav2_map_server does.
CLEAR = np.array([[[255, 255, 255, 255], [255, 255, 255, 0]]], dtype=np.uint8)


@pytest.mark.parametrize(
    ("pixels", "keys", "cells"),
    [
        (SHADES, {}, [100, 100, -1, 0, 0]),
        (TWO, {}, [-1, 0]),  # p of UNKNOWN is below 0.25
        (CLEAR, {"suffix": ".png"}, [0, -1]),  # shade 0.75, p = 0.25
        (SHADES.astype(np.uint16) * 257, {"suffix": ".png"}, [100, 100, -1, 0, 0]),
    ],
)
def test_shades_are_occupied_free_or_unknown(tmp_path, pixels, keys, cells):
    path = write_map(tmp_path, "map", pixels, **keys)
    assert read_map(path).cells[0].tolist() == cells
    if pixels is SHADES and not keys:
        path.write_text(path.read_text().replace("negate: 0", "negate: true"))
        assert read_map(path).cells[0].tolist() == [0, -1, -1, 100, 100]


def test_the_lowest_row_of_the_image_lies_at_the_origin_and_turned_at_its_yaw(tmp_path):
    shades = np.full((4, 6), OCCUPIED, dtype=np.uint8)
    shades[-3:, :3] = FREE
    path = write_map(tmp_path, "map", shades, origin="[10.0, 20.0, 0.0]")
    assert free_area_m(read_map(path)).bounds == pytest.approx((10.0, 20.0, 10.15, 20.15))
    turned = write_map(tmp_path, "turned", shades, origin=f"[10.0, 20.0, {np.pi / 2}]")
    assert free_area_m(read_map(turned)).bounds == pytest.approx((9.85, 20.0, 10.0, 20.15))


PLACED = "resolution: 1\norigin: [0, 0, 0]\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (f"image: none.pgm\n{PLACED}", "none.pgm: it does not exist"),
        (f"image: map.yaml\n{PLACED}", "must be an image (PGM, PNG"),
        ("image: map.pgm\norigin: [0, 0, 0]\n", "resolution is required but missing; add it"),
        ("image: map.pgm\nresolution: 0\norigin: [0, 0, 0]\n", "resolution must be greater than 0"),
        ("image: map.pgm\nresolution: 1e300\norigin: [0, 0, 0]\n",
         "resolution must be less than or equal to 1000000, "),
        (f"image: map.pgm\n{PLACED}free_thresh: 0.7\n",
         "free_thresh must be below occupied_thresh (0.65), got 0.7; lower it"),
        (f"image: map.pgm\n{PLACED}mode: tertiary\n",
         "mode must be 'trinary', got 'tertiary'"),
    ],
)  # fmt: skip
def test_a_bad_map_file_gets_a_sentence(tmp_path, text, sentence):
    path = write_map(tmp_path, "map", SHADES)
    path.write_text(text)
    with pytest.raises(FileError, match=r".") as raised:
        read_map(path)
    assert sentence in str(raised.value)


def test_a_map_without_free_cells_gets_a_sentence(tmp_path):
    path = write_map(tmp_path, "map", np.full((9, 9), UNKNOWN, dtype=np.uint8))
    with pytest.raises(AppError, match="free area at least three cells wide, got none"):
        free_area_m(read_map(path))
