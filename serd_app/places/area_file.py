"""A walkable area from a file of polygons in metres: WKT or GeoJSON.

All polygons of the file together are the area, holes are solids. The connected part that counts is
the largest, or the one around a point.
"""

from pathlib import Path

import numpy as np
import shapely

from serd_app.errors import AppError
from serd_app.places.free_area import largest
from storage.errors import FileError
from storage.files import read_text

#: How each format is read, by suffix.
_READERS = {
    ".wkt": shapely.from_wkt,
    ".geojson": shapely.from_geojson,
    ".json": shapely.from_geojson,
}
_PRECISION_M = 0.001
#: Longitude and latitude, which GeoJSON is made for, would be an area of this size in metres.
_SMALLEST_M2 = 0.25


def is_area_file(path: Path) -> bool:
    """Whether a file holds polygons, by its suffix."""
    return path.suffix.lower() in _READERS


def require_area_file(path: Path) -> None:
    """AppError unless it is one, by its suffix."""
    if not is_area_file(path):
        raise AppError(f"{path} must end in {', '.join(_READERS)}; export the polygons as one")


def read_area_m(path: Path, at_m: tuple[float, float] | None = None) -> shapely.Polygon:
    """The connected area around a point, by default the largest one.

    FileError where the file has no sound polygons; AppError where none is around the point.
    """
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # of numbers that are not finite
            shape = shapely.force_2d(_READERS[path.suffix.lower()](read_text(path)))
    except (shapely.GEOSException, UnicodeDecodeError) as error:  # the other: of GEOS's own message
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise FileError(
            f"{path} must hold polygons as WKT or GeoJSON, got an error for them: {reason}; export"
            " them again"
        ) from None
    polygons = [
        each for each in _parts(shape) if isinstance(each, shapely.Polygon) and not each.is_empty
    ]
    if not polygons:
        raise FileError(
            f"{path} must hold a polygon, got {shape.geom_type} {'EMPTY' * shape.is_empty}".rstrip()
            + "; draw the outline of the walkable area"
        )
    for number, polygon in enumerate(polygons, start=1):
        if not shapely.is_valid(polygon):
            raise FileError(
                f"{path}: polygon {number} must have a sound outline, got"
                f" {shapely.is_valid_reason(polygon)}; correct its corners"
            )
    whole = shapely.get_parts(shapely.union_all(polygons))
    parts = [each for each in whole if at_m is None or _holds(each, at_m)]
    if not parts:
        raise AppError(f"start must be in the area of {path}, got {at_m}; name a point in it")
    found = largest(shapely.MultiPolygon(parts))
    if found.area < _SMALLEST_M2:
        raise FileError(
            f"{path} must be in metres, but its area is {found.area:.3g} m²; project longitude and"
            " latitude to a plane first"
        )
    return largest(shapely.set_precision(found, _PRECISION_M))


def _parts(shape: shapely.Geometry) -> list[shapely.Geometry]:
    """The single geometries of collections within collections."""
    if isinstance(shape, shapely.MultiPolygon | shapely.GeometryCollection):
        return [part for each in shape.geoms for part in _parts(each)]
    return [shape]


def _holds(part: shapely.Polygon, at_m: tuple[float, float]) -> bool:
    return bool(shapely.intersects(part, shapely.Point(at_m)))
