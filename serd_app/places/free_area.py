"""Walkable areas as polygons with holes, whose edges are the walls of a scenario: the free area of
a raster, or that of a file of polygons in metres, WKT or GeoJSON, or of an archive of people.

All polygons of a file together are its area, holes are solids. The connected part that counts is
the largest, or the one around a point.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely
from scipy.ndimage import binary_opening, label

from serd_app.errors import AppError
from serd_bag.errors import FileError
from serd_bag.files import read_text
from serd_core.arrays import BoolArray
from serd_files.trajectories.databases import area_of_database, is_of_database
from serd_sim.safety.motion import in_frame, out_of_frame
from serd_sim.scenario.occupancy import OccupancyRaster

#: Occupancies below this, in percent, are free; unknown cells are not.
_FREE_BELOW = 50
#: Free gaps of fewer cells than this are closed: single rays beyond a wall, slits between shelves.
_NARROWEST_GAP = 3
#: Largest distance, in cells, from the border of the raster's cells to the simplified walls.
_TOLERANCE = 1.0
_PRECISION_M = 0.001
#: How each format is read, by suffix.
_READERS = {
    ".wkt": shapely.from_wkt,
    ".geojson": shapely.from_geojson,
    ".json": shapely.from_geojson,
}
#: Longitude and latitude, which GeoJSON is made for, would be an area of this size in metres.
_SMALLEST_M2 = 0.25


def free_area_m(
    raster: OccupancyRaster, at_m: tuple[float, float] | None = None
) -> shapely.Polygon:
    """The connected free area around a point, by default the largest one, in the frame of the map.

    Gaps narrower than three cells of the raster are closed; walls lie within one cell of the
    raster's. AppError where nothing is free (there).
    """
    free = (raster.cells >= 0) & (raster.cells < _FREE_BELOW)
    free = binary_opening(free, np.ones((_NARROWEST_GAP, _NARROWEST_GAP)))
    labels, count = label(free)
    if not count:
        raise AppError(
            "the map must have a free area at least three cells wide, got none; check its"
            " thresholds and `negate`"
        )
    size_m, frame = raster.resolution_m, (*raster.origin_m, raster.yaw_rad)
    number = 1 + int(np.argmax(np.bincount(labels[free])[1:]))
    if at_m is not None:
        cell = np.floor(in_frame(np.array([at_m]), frame)[0, ::-1] / size_m)
        inside = ((cell >= 0) & (cell < free.shape)).all()
        number = labels[tuple(cell.astype(int))] if inside else 0
        if not number:
            raise AppError(
                f"the point {at_m} m must lie in the free area of the map; name one that does"
            )
    outline = outline_of_cells(labels == number).simplify(_TOLERANCE, preserve_topology=True)
    placed = shapely.transform(outline, lambda corners: out_of_frame(corners * size_m, frame))
    return largest(shapely.set_precision(placed, _PRECISION_M))


def outline_of_cells(walkable: BoolArray) -> shapely.Polygon:
    """The outline of (rows, columns) connected cells with its holes, in cells from the corner."""
    edges = np.diff(np.pad(walkable.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, first = np.nonzero(edges == 1)
    _, last = np.nonzero(edges == -1)
    runs = shapely.box(first, row, last, row + 1)
    return largest(shapely.union_all(runs).simplify(0.0))


def largest(shape: shapely.Geometry) -> shapely.Polygon:
    """The largest polygon of a shape."""
    parts = shapely.get_parts(shape)
    return parts[int(np.argmax(shapely.area(parts)))]


def rings_m(area: shapely.Polygon) -> list[list[tuple[float, float]]]:
    """Corners of the outline and of each hole, the last one not repeated."""
    rings = (area.exterior, *area.interiors)
    return [[(float(x), float(y)) for x, y in ring.coords[:-1]] for ring in rings]


def is_area_file(path: Path) -> bool:
    """Whether a file holds polygons, by its suffix, or is an archive of people with its area."""
    return path.suffix.lower() in _READERS or is_of_database(path)


def require_area_file(path: Path) -> None:
    """AppError unless it is one."""
    if not is_area_file(path):
        raise AppError(f"{path} must end in {', '.join(_READERS)}; export the polygons as one")


def read_area_m(path: Path, at_m: tuple[float, float] | None = None) -> shapely.Polygon:
    """The connected area around a point, by default the largest one.

    FileError where the file has no sound polygons; AppError where none is around the point.
    """
    parts = shapely.get_parts(shapely.union_all(_polygons_of(path)))
    if at_m is not None:
        parts = parts[shapely.intersects(parts, shapely.Point(at_m))]
    if not len(parts):
        raise AppError(f"start must be in the area of {path}, got {at_m}; name a point in it")
    found = largest(shapely.MultiPolygon(list(parts)))
    if found.area < _SMALLEST_M2:
        raise FileError(
            f"{path} must be in metres, but its area is {found.area:.3g} m²; project longitude and"
            " latitude to a plane first"
        )
    return largest(shapely.set_precision(found, _PRECISION_M))


def stated_area_m(paths: Sequence[Path]) -> shapely.Polygon | None:
    """The area that the first archive of people states, None where none does."""
    archives = (path for path in paths if is_of_database(path))
    stated = next((path for path in archives if area_of_database(path)), None)
    return None if stated is None else read_area_m(stated)


def _polygons_of(path: Path) -> list[shapely.Polygon]:
    """Those of a file, at least one, each with a sound outline; else FileError."""
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # of numbers that are not finite
            if is_of_database(path):
                shape = area_of_database(path) or shapely.Polygon()
            else:
                shape = shapely.force_2d(_READERS[path.suffix.lower()](read_text(path)))
    except (shapely.GEOSException, UnicodeDecodeError) as error:  # the other: of GEOS's own message
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise FileError(
            f"{path} must hold polygons as WKT or GeoJSON, got an error for them: {reason}; export"
            " them again"
        ) from None
    parts = _parts(shape)
    polygons = [part for part in parts if isinstance(part, shapely.Polygon) and not part.is_empty]
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
    return polygons


def _parts(shape: shapely.Geometry) -> list[shapely.Geometry]:
    """The single geometries of collections within collections."""
    if isinstance(shape, shapely.MultiPolygon | shapely.GeometryCollection):
        return [part for inner in shape.geoms for part in _parts(inner)]
    return [shape]
