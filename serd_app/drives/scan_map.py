"""The map of a recording: its last occupancy grid, or what its own scans show.

From scans, each ray that hits something lowers the log odds of the cells that it crosses and raises
those of the cell in which it ends (Moravec and Elfes, ICRA 1985). Readings that are no hit (0, NaN,
infinite, beyond the range) change nothing: many lidars give them for glass and dark walls too.
"""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from serd_app.drives.actions import PoseTrack
from serd_app.drives.transforms import RecordedTransforms, plain_name
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import store_of
from serd_bag.messages.plain import decode, header_of
from serd_bag.topic import RawMessage, Topic
from serd_core.arrays import FloatArray

SCAN, GRID = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/OccupancyGrid"
_SCANS, _GRIDS = (SCAN, "sensor_msgs/LaserScan"), (GRID, "nav_msgs/OccupancyGrid")
_CELL_M = 0.1
#: Changes of the log odds, and their limit.
_FREE, _HIT, _MOST = -0.4, 0.85, 4.0
#: Most scans and rays of each that are drawn, spread evenly, and the longest way of a ray (m).
_MOST_SCANS, _MOST_RAYS, _FARTHEST_M = 400, 180, 12.0
_MOST_CELLS = 4_000_000


@dataclass(frozen=True, eq=False)
class PlaceMap:
    """log_odds (H, W) of being occupied, 0 where nothing is known; row 0 is the lowest y.

    origin_m: of the lower-left corner; about: what it was made of.
    """

    origin_m: tuple[float, float]
    cell_m: float
    log_odds: FloatArray
    about: str


@dataclass(frozen=True, eq=False)
class _Scan:
    """angle_rad, range_m: (R,) of the rays that hit something."""

    log_s: float
    stamp_s: float
    frame: str
    angle_rad: FloatArray
    range_m: FloatArray


class RecordedMap:
    """Collects the scans and occupancy grids of a recording, with /tf.

    known: topics of the recording; topics: those to take messages of.
    """

    def __init__(self, known: dict[str, Topic]) -> None:
        self.tf = RecordedTransforms(known)
        kinds = {name: topic.type_name for name, topic in known.items()}
        scans = [name for name, kind in kinds.items() if kind in _SCANS]
        grids = [name for name, kind in kinds.items() if kind in _GRIDS and "costmap" not in name]
        self._scan_topic = min(scans, key=len, default="")
        self._grid_topic = min(grids, key=len, default="")
        self._known, self._scans = known, list[_Scan]()
        self._grid: Any = None
        self.topics = {self._scan_topic, self._grid_topic, *self.tf.topics} - {""}

    def take(self, message: RawMessage) -> None:
        """A message of one of the topics; what is damaged is left out."""
        with suppress(BagError):
            if self.tf.take(message):
                return
            if message.topic in (self._scan_topic, self._grid_topic):
                topic = self._known[message.topic]
                found = decode(message.data, topic.type_name, store_of(topic))
                if message.topic == self._grid_topic:
                    self._grid = found
                else:
                    self._scans.append(_scan_of(found, message.log_time_ns / 1e9))

    def map(self, track: PoseTrack | None) -> PlaceMap | None:
        """The map in the frame of the poses; None without grid and scans that can be placed."""
        if self._grid is not None and len(self._grid.data):
            return _map_of_grid(self._grid, self._grid_topic)
        if track is None or not self._scans:
            return None
        scans = self._scans[:: 1 + len(self._scans) // _MOST_SCANS]
        poses = self._poses(scans, track)
        placed = [
            (each, at) for each, at in zip(scans, poses, strict=True) if np.isfinite(at).all()
        ]
        return _from_scans(placed, self._scan_topic) if placed else None

    def _poses(self, scans: list[_Scan], track: PoseTrack) -> FloatArray:
        """(N, 3) of the lidar at each scan: the robot's, moved by its mounting where /tf has it."""
        log_s, stamp_s = (
            np.array([getattr(s, key) for s in scans]) for key in ("log_s", "stamp_s")
        )
        time_s = track.placed(log_s, stamp_s)
        yaw_rad = np.interp(time_s, track.time_s, np.unwrap(track.poses[:, 2]))
        found = np.column_stack([track.at(time_s), yaw_rad])
        found[(time_s < track.time_s[0]) | (time_s > track.time_s[-1])] = np.nan
        body = next((name for name in self.tf.chain(scans[0].frame)[1:] if "base" in name), "")
        if not body:
            return found
        try:
            matrix = self.tf.placements(body, scans[0].frame, np.zeros(1))[0]
        except BagError:
            return found
        if np.isfinite(matrix).all():
            x_m, y_m, turn = matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])
            cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
            found += np.column_stack([cos * x_m - sin * y_m, sin * x_m + cos * y_m, 0 * cos + turn])
        return found


def _scan_of(message: Any, log_s: float) -> _Scan:
    header = header_of(message.header)
    ranges = np.asarray(message.ranges, dtype=np.float64)
    angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
    step = 1 + len(ranges) // _MOST_RAYS
    ranges, angles = ranges[::step], angles[::step]
    least_m, most_m = float(message.range_min), float(message.range_max)
    hits = np.isfinite(ranges) & (ranges > max(least_m, 0.0)) & (ranges < most_m)
    frame, near_m = plain_name(header.frame), ranges[hits].clip(0.0, _FARTHEST_M)
    return _Scan(log_s, header.stamp_ns / 1e9, frame, angles[hits], near_m)


def _from_scans(placed: list[tuple[_Scan, FloatArray]], topic: str) -> PlaceMap | None:
    """The log odds of all cells that rays reach; None where these are none or too many."""
    placed = [(scan, pose) for scan, pose in placed if len(scan.range_m)]
    if not placed:
        return None
    ends = [_ends_m(scan, pose) for scan, pose in placed]
    every = np.concatenate([*ends, np.array([pose[:2] for _, pose in placed])])
    low = np.floor(every.min(axis=0) / _CELL_M) * _CELL_M - _CELL_M
    columns, rows = (np.ceil((every.max(axis=0) - low) / _CELL_M) + 1).astype(int)
    if rows * columns > _MOST_CELLS:
        return None
    odds = np.zeros(rows * columns)
    for (_, pose), end_m in zip(placed, ends, strict=True):
        length_m = np.linalg.norm(end_m - pose[:2], axis=1)
        shares = np.arange(0.0, max(length_m.max(initial=0.0), _CELL_M), 0.8 * _CELL_M)
        along = shares[None, :] < (length_m - _CELL_M)[:, None]
        ray, step = np.nonzero(along)
        way = (end_m - pose[:2])[ray] / length_m[ray, None]
        free = _cells(pose[:2] + way * shares[step, None], low, columns)
        hit = np.unique(_cells(end_m[length_m < _FARTHEST_M], low, columns))
        odds[np.setdiff1d(np.unique(free), hit)] += _FREE
        odds[hit] += _HIT
        np.clip(odds, -_MOST, _MOST, out=odds)
    about = f"from {len(placed)} scans of {topic} along the poses"
    return PlaceMap((float(low[0]), float(low[1])), _CELL_M, odds.reshape(rows, columns), about)


def _ends_m(scan: _Scan, pose: FloatArray) -> FloatArray:
    angle = scan.angle_rad + pose[2]
    ways = scan.range_m[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray(pose[:2] + ways, dtype=np.float64)


def _cells(points_m: FloatArray, low_m: FloatArray, columns: int) -> Any:
    at = np.floor((points_m - low_m) / _CELL_M).astype(np.int64)
    return at[:, 1] * columns + at[:, 0]


def _map_of_grid(message: Any, topic: str) -> PlaceMap:
    info = message.info
    cells = np.asarray(message.data, dtype=np.int16).reshape(info.height, info.width)
    odds = np.where(
        cells < 0, 0.0, np.where(cells >= 65, _MOST, np.where(cells <= 25, -_MOST, 0.0))
    )
    at = info.origin.position
    return PlaceMap((float(at.x), float(at.y)), float(info.resolution), odds, f"of {topic}")
