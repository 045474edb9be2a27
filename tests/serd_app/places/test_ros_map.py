"""Maps of nav2_map_server and of bags: every mode of shades, and where the map lies."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from serd_app.errors import AppError
from serd_app.places.free_area import free_area_m
from serd_app.places.ros_map import read_map
from serd_bag.errors import BagError, FileError
from support import bag_messages
from support.ros_maps import FREE, OCCUPIED, UNKNOWN, write_map

_STORE = get_typestore(Stores.ROS2_JAZZY)
#: Black, dark, middle, bright, white: p = 1, 0.75, 0.498, 0.2, 0.
SHADES = np.array([[0, 64, 128, 204, 255]], dtype=np.uint8)


RAW = np.array([[0, 40, 100, 101, 255]], dtype=np.uint8)
TWO = np.array([[UNKNOWN, FREE]], dtype=np.uint8)
#: White, and white that is transparent: the opacity is averaged in, as nav2_map_server does.
CLEAR = np.array([[[255, 255, 255, 255], [255, 255, 255, 0]]], dtype=np.uint8)


@pytest.mark.parametrize(
    ("pixels", "keys", "cells"),
    [
        (SHADES, {}, [100, 100, -1, 0, 0]),
        (SHADES, {"keys": "mode: scale\n"}, [100, 100, 62, 0, 0]),  # (0.498 - 0.25) / 0.4 = 62 %
        (RAW, {"keys": "mode: raw\n"}, [0, 40, 100, -1, -1]),
        (TWO, {}, [-1, 0]),  # p of UNKNOWN is below 0.25
        (CLEAR, {"suffix": ".png", "keys": "mode: scale\n"}, [0, -1]),
        (CLEAR, {"suffix": ".png"}, [0, -1]),  # shade 0.75, p = 0.25
        (SHADES.astype(np.uint16) * 257, {"suffix": ".png"}, [100, 100, -1, 0, 0]),
    ],
)
def test_each_mode_of_shades_has_its_percents(tmp_path, pixels, keys, cells):
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


def occupancy_grid(cells, *, origin=(1.0, 2.0), yaw=0.0, resolution=0.05):
    """(H, W) percents as a message."""
    kinds = _STORE.types
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](1, 0), "map")
    pose = kinds["geometry_msgs/msg/Pose"](
        kinds["geometry_msgs/msg/Point"](*origin, 0.0),
        kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)),
    )
    info = kinds["nav_msgs/msg/MapMetaData"](header.stamp, resolution, *cells.shape[::-1], pose)
    name = "nav_msgs/msg/OccupancyGrid"
    message = kinds[name](header, info, cells.astype(np.int8).ravel())
    return bytes(_STORE.serialize_cdr(message, name))


def write_bag(folder, *grids, kind="nav_msgs/msg/OccupancyGrid"):
    rows = (("/map", number, data) for number, data in enumerate(grids))
    return bag_messages.write_bag(folder, {"/map": kind}, rows)


def test_the_last_map_of_a_bag_is_read_in_its_place(tmp_path):
    first, last = np.zeros((6, 8)), np.zeros((6, 8))
    last[0], last[:, -1] = 100, -1
    bag = write_bag(tmp_path / "bag", occupancy_grid(first), occupancy_grid(last, yaw=np.pi / 2))
    raster = read_map(bag)
    assert raster.cells.tolist() == last.tolist()
    assert (raster.origin_m, raster.resolution_m) == ((1.0, 2.0), 0.05)
    assert free_area_m(raster).bounds == pytest.approx((0.7, 2.0, 0.95, 2.35))


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
         "mode must be 'trinary', 'scale' or 'raw', got 'tertiary'"),
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


def test_a_bag_without_a_map_or_with_one_without_a_resolution_gets_a_sentence(tmp_path):
    other = write_bag(tmp_path / "other", kind="std_msgs/msg/String")
    with pytest.raises(AppError, match="must be of type nav_msgs/msg/OccupancyGrid"):
        read_map(other)
    with pytest.raises(BagError, match="must hold the topic 'costmap'"):
        read_map(other, "costmap")
    with pytest.raises(AppError, match="it holds no message"):
        read_map(write_bag(tmp_path / "empty"))
    for resolution in (0.0, -0.05, np.nan, np.inf):
        grid = occupancy_grid(np.zeros((4, 4)), resolution=resolution)
        bag = write_bag(tmp_path / f"grid {resolution}", grid)
        with pytest.raises(AppError, match=r"/map: the map's resolution must be finite and great"):
            read_map(bag)
