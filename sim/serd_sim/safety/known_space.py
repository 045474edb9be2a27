"""What scans have shown of the space around a robot, also where the newest one shows nothing.

Each ray has an end: a return, or range_max where it is free. A ray is *blind* where it states
nothing, or where it is lost: it reads free although something was in reach. What is known along a
blind ray is the largest of

    d - v (t - t'),    min(r, s / w),    e

d: distance to the nearest end of earlier scans along it, seen at t', less what a person of speed v
has walked since; r: the nearer of the ends beside the gap of blind rays, whose width w (rad) hides
no obstacle of size s that is nearer than s / w; e: the edge of the footprint.

A return nearer than range_min is where an earlier end along its ray is by now, else at the edge of
the footprint. Where range_max is short the known space ends there.

A sector is lost where rays turn free at once over more than a person uncovers between two scans,
and what vanishes beside it, until these rays have returns; or where the map has a wall in reach.
What vanishes over less is held as an obstacle for a moment.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_sim.planning.rollout_costs import distance_to_nearest
from serd_sim.robot.footprint import Footprint
from serd_sim.robot.sensors import crossings, range_to_lines
from serd_sim.safety.motion import STANDING, Pose, compose, in_frame, motion_between, out_of_frame
from serd_sim.safety.scan import Scan, ScanGeometry, runs_of
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.polygon import edges_of

#: Size (m) of the smallest obstacle that counts between rays.
_SMALLEST_M = 0.1
#: Error (m) allowed between what is in reach and the range at which it is expected.
_RANGE_ERROR_M = 0.3
#: Rays that turn free over this width (m), beyond what a person uncovers, are a lost sector.
_LOST_WIDTH_M = 0.2
_LOST_RAYS = 3
#: Rays beside a blind one whose earlier ends count for it too, since the robot has moved.
_BESIDE = 2
#: Ends that nothing shows any more are remembered for this time (s).
_REMEMBERED_S = 10.0
#: Of what has left the view one place is remembered in each square of this side (m).
_SQUARE_M = 0.02
#: An obstacle stays for this time (s) where a ray that met it turns free.
_HELD_S = 0.5
#: The lidar looks in a direction where it has a ray within this angle (rad).
_ABOUT_RAD = 0.1
#: Between rays that are farther apart it does not look, and each return is as wide as their gap.
_APART_RAD = 2.0 * _ABOUT_RAD
#: Scan points nearer than this (m) to the body of a person belong to that person.
BODY_MARGIN_M = 0.15
NO_POINTS: FloatArray = np.zeros((0, 2))


@dataclass(frozen=True, eq=False)
class SeenSpace:
    """Obstacles in the robot's frame at a scan.

    points_m: (N, 2) returns. unknown_m: (M, 2) places where the known space ends along blind rays.
    blind_share: of all rays. lost: whether a sector is lost. ahead, behind, around: whether the
    lidar looks there.
    """

    points_m: FloatArray = field(default_factory=lambda: NO_POINTS)
    unknown_m: FloatArray = field(default_factory=lambda: NO_POINTS)
    blind_share: float = 0.0
    lost: bool = False
    ahead: bool = True
    behind: bool = True
    around: bool = True


@dataclass(frozen=True, eq=False)
class _Ends:
    """place_m: (N, 2) in the frame of odometry. stamp_s, is_solid: (N,), whether it is a return.

    was_gone: (N,) whether a ray has read free there since.
    """

    place_m: FloatArray
    stamp_s: FloatArray
    is_solid: BoolArray
    was_gone: BoolArray

    def among(self, rows: BoolArray) -> "_Ends":
        return _Ends(*(each[rows] for each in vars(self).values()))

    def __add__(self, other: "_Ends") -> "_Ends":
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return _Ends(*map(np.concatenate, pairs))


_NO_ENDS = _Ends(NO_POINTS, np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0, dtype=bool))


class KnownSpace:
    """Keeps the ends of rays of earlier scans where newer ones show nothing.

    walls_m: (W, 2, 2) segments of the map, None without one. reach_m: distance from the robot's
    centre up to which an obstacle can matter; both may be replaced.
    """

    def __init__(self, settings: GuardSettings, walls_m: FloatArray | None, reach_m: float) -> None:
        self.settings, self._walls_m, self.reach_m = settings, walls_m, reach_m
        #: Of the rays of a geometry.
        self._lost: tuple[ScanGeometry, BoolArray] | None = None
        self.begin_session()

    def begin_session(self) -> None:
        """Discard where something was. Lost sectors are in the lidar's frame, and stay."""
        self._kept = self._newest = _NO_ENDS
        self._odometry, self._stamp_s = STANDING, -math.inf

    def take(
        self, raw: Scan, odometry: Pose, people_m: FloatArray, in_map: Pose | None
    ) -> tuple[Scan, SeenSpace]:
        """The interpreted scan, and what is known after it.

        odometry, in_map: poses of the robot at its stamp. people_m: (P, 2) known people in the
        robot's frame, who are not held after they have gone.
        """
        settings = self.settings
        mount = self.mount_of(raw)
        interpreted, near = raw.interpreted(settings.zero_is)
        scan = interpreted.dense(_APART_RAD)
        near = np.repeat(near, len(scan.ranges_m) // len(near))
        edge_m = _edge_m(scan.geometry, len(scan.ranges_m), mount, settings.outline)
        free, unknown = np.isposinf(scan.ranges_m), np.isnan(scan.ranges_m)
        lidar = compose(odometry, mount)
        ends = self._kept + self._newest
        place_m = in_frame(ends.place_m, lidar)
        away_m = np.hypot(place_m[:, 0], place_m[:, 1])
        ray = scan.geometry.rays_towards(np.arctan2(place_m[:, 1], place_m[:, 0]), len(free))
        inside = ray >= 0
        gone = ends.is_solid & inside & free[ray] & _in_reach(away_m, scan)
        at_once = gone & ~ends.was_gone
        lost = self._lost_rays(scan, free, ray[at_once], away_m[at_once], odometry)
        if self._walls_m is not None and in_map is not None and free.any():
            at_walls = self._rays_at_walls(interpreted, compose(in_map, mount))
            lost |= np.repeat(at_walls, len(free) // len(at_walls))
        blind = unknown | lost
        age_s = scan.stamp_s - ends.stamp_s
        held = gone & ~blind[ray] & (age_s <= _HELD_S)
        is_recent = age_s <= _REMEMBERED_S
        # What the robot has turned away from, or driven past.
        left = ~inside & ends.is_solid & is_recent & (away_m <= self.reach_m)
        left = _thinned(ends.place_m, left)
        left_m = np.maximum(away_m - settings.person_speed * age_s, 0.0)
        along_blind = inside & blind[ray]
        end_m = np.where(free, scan.geometry.range_max_m, scan.ranges_m.astype(np.float64))
        stays = inside & near[ray] & ends.is_solid & (away_m <= scan.geometry.range_min_m)
        # Without an earlier end it may be anywhere nearer than range_min.
        end_m[near] = np.inf
        np.minimum.at(end_m, ray[stays], away_m[stays])
        end_m[near] = np.where(np.isinf(end_m), edge_m, np.maximum(end_m, edge_m))[near]
        known_m = _known_m(scan, blind, end_m, ray[along_blind], left_m[along_blind])
        points_m = self._points(scan, mount, ~(free | unknown), end_m)
        looks = abs(raw.geometry.angle_increment_rad) <= _APART_RAD
        seen = SeenSpace(
            points_m=np.concatenate([points_m, out_of_frame(place_m[held | left], mount)]),
            unknown_m=self._points(
                scan, mount, blind | free, np.where(blind, np.maximum(known_m, edge_m), end_m)
            ),
            blind_share=float(blind.mean()),
            lost=bool(lost.any()),
            ahead=looks and self._looks(scan, mount, 0.0),
            behind=looks and self._looks(scan, mount, math.pi),
            around=looks and scan.geometry.closes(len(free)),
        )
        ends.was_gone[gone] = True
        hidden = (along_blind | (inside & near[ray])) & is_recent
        self._kept = ends.among(held | hidden | left)
        shown = ~blind
        shown[ray[stays]] = False
        self._remember(scan, mount, lidar, shown, end_m, people_m)
        self._odometry, self._stamp_s = odometry, scan.stamp_s
        return scan, seen

    def mount_of(self, scan: Scan) -> Pose:
        """Where the lidar is on the robot."""
        at = self.settings
        return (at.sensor_x, at.sensor_y, at.sensor_yaw) if scan.mount is None else scan.mount

    def _lost_rays(
        self, scan: Scan, free: BoolArray, ray: IntArray, away_m: FloatArray, odometry: Pose
    ) -> BoolArray:
        """(n_rays,) which rays are in a lost sector; a ray is until it has a return.

        ray, away_m: (N,) of ends that have just gone. What goes beside a lost sector is lost, too.
        """
        lost = self._still_lost(scan)
        if len(ray):
            vanished_m = np.zeros(len(free))
            vanished_m[ray] = away_m
            x_m, y_m, turn = motion_between(self._odometry, odometry)
            uncovered_m = self.settings.person_speed * (scan.stamp_s - self._stamp_s)
            uncovered_m += math.hypot(x_m, y_m)
            grown = _joined((vanished_m > 0.0) | lost)
            for run in runs_of(grown, closes=scan.geometry.closes(len(free))):
                lost[run] |= lost[run].any() & (vanished_m[run] > 0.0)
            lost |= _wide_sectors(scan, vanished_m, uncovered_m, abs(turn))
        lost &= ~np.isfinite(scan.ranges_m)
        self._lost = scan.geometry, lost
        return lost & free

    def _still_lost(self, scan: Scan) -> BoolArray:
        """(n_rays,) lost rays of the scan before, whose number of rays may have been another."""
        n_rays = len(scan.ranges_m)
        if self._lost is None:
            return np.zeros(n_rays, dtype=bool)
        geometry, lost = self._lost
        if geometry == scan.geometry and len(lost) == n_rays:
            return lost.copy()
        ray = geometry.rays_towards(scan.angles_rad, len(lost))
        return (ray >= 0) & lost[ray]

    def _rays_at_walls(self, scan: Scan, lidar: Pose) -> BoolArray:
        """(n_rays,) rays in sectors that are free although the map has a wall in reach."""
        assert self._walls_m is not None
        free = np.isposinf(scan.ranges_m)
        ray = free.nonzero()[0]
        angle = scan.angles_rad[ray] + lidar[2]
        start_m, along_m = self._walls_m[:, 0] - lidar[:2], np.diff(self._walls_m, axis=1)[:, 0]
        half_m = 0.5 * along_m
        to_middle_m = np.hypot(*(start_m + half_m).T) - np.hypot(*half_m.T)
        start_m, along_m = (each[_in_reach(to_middle_m, scan)] for each in (start_m, along_m))
        to_wall_m = range_to_lines(
            start_m[:, 0], start_m[:, 1], along_m, np.cos(angle), np.sin(angle)
        )
        missing_m = np.zeros(len(free))
        missing_m[ray] = np.where(_in_reach(to_wall_m, scan), to_wall_m, 0.0)
        return _wide_sectors(scan, missing_m, 0.0, 0.0)

    def _points(self, scan: Scan, mount: Pose, rays: BoolArray, end_m: FloatArray) -> FloatArray:
        """(N, 2) ends of some rays near the robot, in its frame."""
        near = (rays & (end_m <= self.reach_m + math.hypot(mount[0], mount[1]))).nonzero()[0]
        return out_of_frame(end_m[near, None] * scan.directions[near], mount)

    def _looks(self, scan: Scan, mount: Pose, bearing_rad: float) -> bool:
        """Whether there is a ray about a direction of the robot."""
        towards = bearing_rad - mount[2] + np.array([-_ABOUT_RAD, 0.0, _ABOUT_RAD])
        return bool((scan.geometry.rays_towards(towards, len(scan.ranges_m)) >= 0).any())

    def _remember(
        self,
        scan: Scan,
        mount: Pose,
        lidar: Pose,
        rays: BoolArray,
        end_m: FloatArray,
        people_m: FloatArray,
    ) -> None:
        """Keep the ends of these rays for the next scans."""
        end = end_m[rays, None] * scan.directions[rays]
        is_solid = np.isfinite(scan.ranges_m[rays])
        if len(people_m) and len(end):
            x_m, y_m = out_of_frame(end, mount).T
            away_m = distance_to_nearest(x_m, y_m, people_m[..., None])
            is_solid &= away_m > self.settings.person_radius + BODY_MARGIN_M
        stamp_s, was_gone = np.full(len(end), scan.stamp_s), np.zeros(len(end), dtype=bool)
        self._newest = _Ends(out_of_frame(end, lidar), stamp_s, is_solid, was_gone)


@lru_cache(maxsize=16)
def _edge_m(geometry: ScanGeometry, n_rays: int, mount: Pose, body: Footprint) -> FloatArray:
    """(n_rays,) distance along each ray to where it leaves the footprint; 0 for one that does not
    meet it."""
    angle = geometry.angles_rad(n_rays) + mount[2]
    if not body.is_round:
        x_m, y_m = (body.corners_m - mount[:2]).T
        edge_m = np.diff(edges_of(body.corners_m), axis=1)[:, 0]
        crossed_m = crossings(x_m, y_m, edge_m, np.cos(angle), np.sin(angle))
        farthest_m: FloatArray = np.where(np.isfinite(crossed_m), crossed_m, 0.0).max(axis=1)
        return farthest_m
    along_m = mount[0] * np.cos(angle) + mount[1] * np.sin(angle)
    squared = along_m**2 + body.radius_m**2 - mount[0] ** 2 - mount[1] ** 2
    return np.where(
        squared > 0.0, np.maximum(np.sqrt(np.maximum(squared, 0.0)) - along_m, 0.0), 0.0
    )


def _thinned(place_m: FloatArray, chosen: BoolArray) -> BoolArray:
    """(N,) of the chosen places the last one in each square of `_SQUARE_M`."""
    if not chosen.any():
        return chosen
    rows = chosen.nonzero()[0][::-1]
    east, north = np.floor(place_m[rows].T / _SQUARE_M).astype(np.int64)
    thinned = np.zeros_like(chosen)
    thinned[rows[np.unique(east * 2**31 + north, return_index=True)[1]]] = True
    return thinned


def _in_reach(away_m: FloatArray, scan: Scan) -> BoolArray:
    """Which distances a lidar measures in spite of errors."""
    return away_m + _RANGE_ERROR_M < scan.geometry.range_max_m


def _wide_sectors(scan: Scan, away_m: FloatArray, uncovered_m: float, turn_rad: float) -> BoolArray:
    """(n_rays,) sectors of rays that miss something at distances away_m, 0 where they do not.

    uncovered_m: width that what moves uncovers. turn_rad: of the robot, as error of the bearing.
    """
    misses = away_m > 0.0
    found = np.zeros(len(misses), dtype=bool)
    step_rad = abs(scan.geometry.angle_increment_rad)
    for run in runs_of(_joined(misses), closes=scan.geometry.closes(len(misses))):
        mean_m = float(away_m[run].sum() / max(misses[run].sum(), 1))
        width_m = (len(run) - 1) * step_rad * mean_m
        if len(run) >= _LOST_RAYS and width_m > uncovered_m + _LOST_WIDTH_M + turn_rad * mean_m:
            found[run] = True
    return found


def _joined(rays: BoolArray) -> BoolArray:
    """(n_rays,) with single rays between them: the robot moves, and these have no earlier end."""
    return rays | (np.roll(rays, 1) & np.roll(rays, -1))


def _known_m(
    scan: Scan, blind: BoolArray, end_m: FloatArray, ray: IntArray, left_m: FloatArray
) -> FloatArray:
    """(n_rays,) what is known along blind rays, by earlier ends at left_m (N,) along rays (N,) and
    by the ends beside each gap."""
    n_rays = len(blind)
    known_m = np.zeros(n_rays)
    if not blind.any():
        return known_m
    if len(ray):
        of_ray_m = np.full(n_rays, np.inf)
        np.minimum.at(of_ray_m, ray, left_m)
        beside_m = np.minimum.reduce(
            [np.roll(of_ray_m, shift) for shift in range(-_BESIDE, _BESIDE + 1)]
        )
        known_m = np.where(np.isfinite(beside_m), beside_m, 0.0)
    closes, step_rad = scan.geometry.closes(n_rays), abs(scan.geometry.angle_increment_rad)
    for run in runs_of(blind, closes=closes):
        beside = np.array([run[0] - 1, run[-1] + 1])
        is_bounded = len(run) < n_rays and (closes or (beside[0] >= 0 and beside[1] < n_rays))
        if is_bounded:
            seen_m = min(
                float(end_m[beside % n_rays].min()), _SMALLEST_M / (step_rad * (len(run) + 1))
            )
            known_m[run] = np.maximum(known_m[run], seen_m)
    return known_m
