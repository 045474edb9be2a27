"""Walkable areas of files of polygons."""

import json

import pytest
import shapely

from serd_app.errors import AppError
from serd_app.places.free_area import read_area_m
from serd_bag.errors import FileError

ROOM = shapely.Polygon([(0, 0), (8, 0), (8, 4), (0, 4)], holes=[[(2, 1), (3, 1), (3, 2), (2, 2)]])
HALL = shapely.box(20, 0, 40, 4)


@pytest.fixture
def area_file(tmp_path):
    def write(name, text):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def feature(shape):
    return {"type": "Feature", "properties": {"name": "a"}, "geometry": shape.__geo_interface__}


def test_wkt_and_geojson_hold_the_same_area(area_file):
    collection = {"type": "FeatureCollection", "features": [feature(ROOM), feature(HALL)]}
    both = shapely.MultiPolygon([ROOM, HALL])
    paths = [
        area_file("a.wkt", both.wkt),
        area_file("high.wkt", shapely.force_3d(both, 1.5).wkt),
        area_file("a.geojson", json.dumps(collection)),
        area_file("a.json", json.dumps(both.__geo_interface__)),
    ]
    for path in paths:
        assert read_area_m(path).equals(HALL)
        assert read_area_m(path, (1.0, 1.0)).equals(ROOM)
        with pytest.raises(AppError, match=r"start must be in the area of .*, got \(2.5, 1.5\)"):
            read_area_m(path, (2.5, 1.5))


def test_rooms_that_touch_are_one_area(area_file):
    rooms = shapely.GeometryCollection([shapely.box(0, 0, 4, 4), shapely.box(4, 1, 9, 3)])
    assert read_area_m(area_file("a.wkt", rooms.wkt)).area == pytest.approx(26.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))", "polygon 1 must have a sound outline, got Self-"),
        ("POLYGON ((0 0, nan 4, 4 0, 0 0))", "polygon 1 must have a sound outline, got Invalid"),
        ("POLYGON EMPTY", "must hold a polygon, got Polygon EMPTY; draw the outline"),
        ("POINT (1 2)", "must hold a polygon, got Point; draw the outline"),
        ("", "must hold polygons as WKT or GeoJSON, got an error for them: ParseException"),
        ("POLYGON ((8.40 49.01, 8.41 49.01, 8.41 49.02, 8.40 49.01))", "must be in metres"),
    ],
)
def test_a_file_without_a_sound_area_is_rejected(area_file, text, reason):
    with pytest.raises(FileError) as raised:
        read_area_m(area_file("a.wkt", text))
    assert reason in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("text", ["[]", "{", '{"type": "Feature", "geometry": null}', "1"])
def test_a_file_that_is_no_geojson_is_rejected(area_file, text):
    with pytest.raises(FileError, match="must hold polygons as WKT or GeoJSON"):
        read_area_m(area_file("a.geojson", text))
