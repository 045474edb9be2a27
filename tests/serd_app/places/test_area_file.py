"""Walkable areas of files of polygons."""

import json

import pytest
import shapely

from serd_app.errors import AppError
from serd_app.places.free_area import read_area_m
from serd_bag.errors import FileError

ROOM = shapely.Polygon([(0, 0), (8, 0), (8, 4), (0, 4)], holes=[[(2, 1), (3, 1), (3, 2), (2, 2)]])
HALL = shapely.box(20, 0, 40, 4)


def feature(shape):
    return {"type": "Feature", "properties": {"name": "a"}, "geometry": shape.__geo_interface__}


BOTH = shapely.MultiPolygon([ROOM, HALL])
COLLECTION = {"type": "FeatureCollection", "features": [feature(ROOM), feature(HALL)]}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.wkt", BOTH.wkt),
        ("high.wkt", shapely.force_3d(BOTH, 1.5).wkt),
        ("a.geojson", json.dumps(COLLECTION)),
        ("a.json", json.dumps(BOTH.__geo_interface__)),
    ],
)
def test_wkt_and_geojson_hold_the_same_area(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    assert read_area_m(path).equals(HALL)
    assert read_area_m(path, (1.0, 1.0)).equals(ROOM)
    with pytest.raises(AppError, match=r"start must be in the area of .*, got \(2.5, 1.5\)"):
        read_area_m(path, (2.5, 1.5))


def test_rooms_that_touch_are_one_area(tmp_path):
    rooms = shapely.GeometryCollection([shapely.box(0, 0, 4, 4), shapely.box(4, 1, 9, 3)])
    (tmp_path / "a.wkt").write_text(rooms.wkt)
    assert read_area_m(tmp_path / "a.wkt").area == pytest.approx(26.0)


NONE = "must hold polygons as WKT or GeoJSON, got an error for them: "


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("a.wkt", "POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))", "polygon 1 must have a sound outline"),
        ("a.wkt", "POLYGON ((0 0, nan 4, 4 0, 0 0))", "must have a sound outline, got Invalid"),
        ("a.wkt", "POLYGON EMPTY", "must hold a polygon, got Polygon EMPTY; draw the outline"),
        ("a.wkt", "POINT (1 2)", "must hold a polygon, got Point; draw the outline"),
        ("a.wkt", "", f"{NONE}ParseException"),
        ("a.wkt", "POLYGON ((8.4 49, 8.41 49, 8.41 49.01, 8.4 49))", "must be in metres"),
        *(("a.geojson", text, NONE)
          for text in ("[]", "{", '{"type": "Feature", "geometry": null}', "1")),
    ],
)  # fmt: skip
def test_a_file_without_a_sound_area_is_rejected_in_one_line(tmp_path, name, text, reason):
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError) as raised:
        read_area_m(tmp_path / name)
    assert reason in str(raised.value)
    assert "\n" not in str(raised.value)
