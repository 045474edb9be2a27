"""People who walk through a straight corridor: which way it leads, and who is elsewhere.

Its sides are those of its walkable area, or without one of the smallest rectangle around the cells
in which people were, never those of the ways: people who cross a corridor do not turn it. Which of
the sides people walk along is seen from the mean axis of their ways: of ways at the angles phi_n it
is arg(Z) / 2 with Z = mean exp(2i phi_n), and |Z| is 1 for parallel ones (Mardia and Jupp,
Directional Statistics, 2000, section 9.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from serd_core.arrays import BoolArray
from serd_files.trajectories.read import Track
from serd_sim.errors import SimError

#: |Z| of people who walk in one corridor; two equal flows that cross have 0.
_PARALLEL = 0.8
#: A corridor at a smaller angle to x or y, or of fewer people, is taken as it is.
_ALIGNED_RAD, _FEWEST = np.deg2rad(3.0), 10
#: Cells of places, and the share of the upright rectangle that a turned one must save.
_CELL_M, _SAVED = 0.25, 0.1
#: After a longer step between places, an id is another person.
AWAY_S, AWAY_STEPS = 2.0, 5.0
#: People who are farther than that from the ways of all others are not in the corridor.
_APART_M = 2.0


@dataclass(frozen=True, eq=False)
class CorridorPeople:
    """tracks: of those in the corridor, which is along axis (0: x, 1: y) of their coordinates.

    sides_m: the walls across where an area states them, else None. n_apart: how many are elsewhere;
    remarks: sentences about what was turned or left out.
    """

    tracks: tuple[Track, ...]
    axis: int
    sides_m: tuple[float, float] | None = None
    n_apart: int = 0
    remarks: tuple[str, ...] = ()


def corridor_people(
    tracks: Sequence[Track], area_m: shapely.Polygon | None = None
) -> CorridorPeople:
    """Those who walk in the corridor in which most do, turned where it is not along x or y.

    area_m: its walkable area. SimError where people walk in several directions.
    """
    remarks, tracks = _divided(tracks)
    along_rad = _angle_rad(tracks)
    off_rad = _off_rad(tracks, area_m)
    axis = round((along_rad - off_rad) / (np.pi / 2)) % 2
    if abs(off_rad) > _ALIGNED_RAD and (len(tracks) >= _FEWEST or area_m is not None):
        cos, sin = np.cos(-off_rad), np.sin(-off_rad)
        turn = np.array([[cos, sin], [-sin, cos]])
        tracks = [replace(track, position_m=track.position_m @ turn) for track in tracks]
        remarks.append(
            f"the corridor is at {np.rad2deg(off_rad):.0f}° to the {'xy'[axis]} axis, so places are"
            " turned by that angle"
        )
        if area_m is not None:
            area_m = shapely.transform(area_m, lambda places_m: places_m @ turn)
    inside = _together(tracks, axis)
    inside[inside] = _together(
        [t for t, there in zip(tracks, inside, strict=True) if there], 1 - axis
    )
    apart = np.flatnonzero(~inside)
    if len(apart):
        first = min((tracks[i] for i in apart), key=lambda track: track.row)
        remarks.append(
            f"agent {first.agent}, from row {first.row}, is more than {_APART_M:g} m away from all"
            f" who walk in the corridor{_and_others(len(apart))}; left out"
        )
    kept = tuple(track for track, there in zip(tracks, inside, strict=True) if there)
    sides_m = None
    if area_m is not None:
        sides_m = area_m.bounds[1 - axis], area_m.bounds[3 - axis]
    return CorridorPeople(kept, axis, sides_m, len(apart), tuple(remarks))


def _off_rad(tracks: Sequence[Track], area_m: shapely.Polygon | None) -> float:
    """By how much the sides of the corridor are turned from x and y, at most pi / 4."""
    shape = _where(tracks) if area_m is None else area_m
    turned, upright = shape.minimum_rotated_rectangle, shape.envelope
    if shapely.area(turned) > (1.0 - _SAVED) * shapely.area(upright):
        return 0.0
    edge = np.diff(shapely.get_coordinates(turned)[:2], axis=0)[0]
    quarters = np.arctan2(edge[1], edge[0]) / (np.pi / 2)
    return float(np.pi / 2 * (quarters - round(quarters)))


def _where(tracks: Sequence[Track]) -> shapely.Geometry:
    """The largest group of the cells in which two people or more were, of all where none are."""
    visited = [np.unique(np.floor(track.position_m / _CELL_M), axis=0) for track in tracks]
    cells, counts = np.unique(np.concatenate(visited), axis=0, return_counts=True)
    common = cells[counts >= min(2, counts.max())]
    squares = shapely.box(*(common * _CELL_M).T, *((common + 1) * _CELL_M).T)
    joined = shapely.unary_union(shapely.buffer(squares, _APART_M / 2))
    group = max(shapely.get_parts(joined), key=shapely.area)
    inside = shapely.contains_properly(group, shapely.centroid(squares))
    return shapely.convex_hull(shapely.union_all(squares[inside]))


def longest_step_s(track: Track) -> float:
    """After a longer one, the id may be of another person."""
    return max(AWAY_S, AWAY_STEPS * float(np.median(np.diff(track.time_s))))


def _divided(tracks: Sequence[Track]) -> tuple[list[str], list[Track]]:
    """A sentence where there are such, and the parts of two places or more between long steps."""
    parts, away = list[Track](), list[str]()
    for track in tracks:
        cuts = np.flatnonzero(np.diff(track.time_s) > longest_step_s(track)) + 1
        for rows in np.split(np.arange(len(track.time_s)), cuts):
            if len(rows) > 1:
                times_s, places_m = track.time_s[rows], track.position_m[rows]
                parts.append(replace(track, time_s=times_s, position_m=places_m))
        if len(cuts):
            away_s = track.time_s[cuts[0]] - track.time_s[cuts[0] - 1]
            away.append(f"agent {track.agent}, from row {track.row}, is away for {away_s:.0f} s")
    if not away:
        return [], parts
    return [f"{away[0]}{_and_others(len(away))}; another person from there"], parts


def _angle_rad(tracks: Sequence[Track]) -> float:
    """That of the corridor, between -pi / 2 and pi / 2; people who stay count less."""
    moved_m = np.array([track.position_m[-1] - track.position_m[0] for track in tracks])
    way_m = np.hypot(*moved_m.T)
    share = np.minimum(way_m, np.median(way_m))
    if not share.sum() > 0:
        raise SimError("people must walk through a corridor, but end where they begin; check rows")
    mean = np.sum(share * np.exp(2j * np.arctan2(moved_m[:, 1], moved_m[:, 0]))) / share.sum()
    if abs(mean) < _PARALLEL:
        east_m, north_m = np.median(np.abs(moved_m), axis=0)
        raise SimError(
            "people must walk along one straight corridor, but they walk in several directions"
            f" (half of them {east_m:.1f} m in x and {north_m:.1f} m in y); give the part of the"
            " recording in which all walk along one line"
        )
    return float(np.angle(mean) / 2)


def _together(tracks: Sequence[Track], axis: int) -> BoolArray:
    """(N,) mask of the most tracks whose spans along an axis have no wide gap between them."""
    places_m = (track.position_m[:, axis] for track in tracks)
    spans_m = np.array([(places.min(), places.max()) for places in places_m])
    order = np.argsort(spans_m[:, 0], kind="stable")
    ends_m = np.maximum.accumulate(spans_m[order, 1])
    gaps = spans_m[order[1:], 0] > ends_m[:-1] + _APART_M
    group = np.zeros(len(tracks), dtype=np.int64)
    group[order[1:]] = np.cumsum(gaps)
    return np.asarray(group == np.argmax(np.bincount(group)))


def _and_others(number: int) -> str:
    return "" if number == 1 else f", as {'is' if number == 2 else 'are'} {number - 1} more"
