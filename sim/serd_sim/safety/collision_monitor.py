"""Stop, slowdown and approach zones round the footprint of a robot, after Nav2's monitor.

Approach zone: a command is followed for one period and the reaction time, then the robot brakes.
With F(t) the footprint on that path, where a polygon turns with the robot, d the distance from its
outline (below 0 inside), and q_j(t) = q_j + u_j t the place of an obstacle of radius r_j, the
command is forbidden where for some t before the robot stands

    d(F(t), q_j(t)) - r_j < min(margin, gap_j(t) of a robot that stands)

Scan points stand (u = 0, r_j = 0), people walk straight on. Where only the scan shows people, its
points may come from every side: the margin grows by their speed times t. The second argument of the
minimum lets the robot leave an obstacle that it touches. Points within the footprint show that the
body is smaller: where nothing else is allowed the robot creeps, and others may come as near. Where
the known space ends there is an obstacle, so that the robot can stop within what is known. A robot
that brakes from an allowed command stays on the path that was checked, so braking is always
allowed.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_sim.robot.footprint import Footprint, footprint_of
from serd_sim.safety.known_space import NO_POINTS
from serd_sim.safety.motion import Pose
from serd_sim.safety.reasons import Fault, GuardAction, Reason, Source
from serd_sim.safety.settings import CREEP_MPS, GuardSettings
from serd_sim.world.command import STOP, Command, limited_velocity

#: Shares of a command that are tried in turn.
_SHARES = (1.0, 0.75, 0.5, 0.25)
#: How far (m) a corner moves between two poses of a polygon that are checked.
_FINE_M = 0.02
#: How much nearer (m) an obstacle within the margin may come on one path: rounding of its place.
_ROUNDING_M = 1e-4
_NO_REASON: tuple[Reason, ...] = ()


@dataclass(frozen=True, eq=False)
class Obstacles:
    """In the robot's frame: scan points (N, 2), people (M, 2) and their velocities (M, 2).

    points_mps: speed at which points may come nearer. unknown_m: (K, 2) places where nothing is
    known any more.
    """

    points_m: FloatArray
    people_m: FloatArray
    people_mps: FloatArray
    points_mps: float = 0.0
    unknown_m: FloatArray = field(default_factory=lambda: NO_POINTS)


@dataclass(frozen=True, eq=False)
class _Path:
    """(n, 3) poses of the robot, its frame being that at time 0; (n,) times; length of the way.

    swept_m: how far a part of the footprint moves at most; a disc that turns stays where it is.
    """

    poses: FloatArray
    time_s: FloatArray
    length_m: float
    swept_m: float


class CollisionMonitor:
    """Returns the largest share of a command that is allowed."""

    def __init__(self, settings: GuardSettings) -> None:
        self._settings, self._robot, self._body = settings, settings.robot(), settings.outline
        self._stop_zone = footprint_of(settings.stop_radius, "")
        self._step_s = 1.0 / settings.controller_frequency
        self._n_follow = 1 + math.ceil(settings.reaction_time / self._step_s - 1e-9)

    def step(
        self, command: Command, speeds: tuple[float, float], obstacles: Obstacles
    ) -> tuple[Command, GuardAction, tuple[Reason, ...]]:
        """The allowed command. speeds: (m/s, rad/s) of the robot now."""
        zone = self._slowdown_zone(obstacles)
        if zone:
            command = _scaled(command, self._settings.slowdown_ratio)
        found = _NO_REASON
        for share in _SHARES:
            tried = _scaled(command, share)
            reasons = self._collisions(tried, speeds, obstacles)
            if not reasons:
                action = GuardAction.APPROACH if found else GuardAction.DO_NOTHING
                return tried, GuardAction.SLOWDOWN if zone and not found else action, zone + found
            found = found or reasons
            if tried.linear_mps == 0.0 and self._body.is_round:
                break
        slow = _scaled(command, min(1.0, CREEP_MPS / max(self._fastest_mps(command), 1e-9)))
        if self._touches(obstacles) and not self._collisions(slow, speeds, obstacles, leaves=True):
            return slow, GuardAction.APPROACH, zone + found
        turn = Command(0.0, command.angular_radps)
        allowed = not self._collisions(turn, speeds, obstacles)
        return turn if allowed else STOP, GuardAction.STOP, zone + found

    def _fastest_mps(self, command: Command) -> float:
        """Speed of the centre, or at most that of a corner."""
        corner_m = 0.0 if self._body.is_round else self._body.radius_m
        return abs(command.linear_mps) + corner_m * abs(command.angular_radps)

    def _touches(self, obstacles: Obstacles) -> bool:
        """Whether scan points are within the footprint."""
        near = np.hypot(*obstacles.points_m.T) < self._body.radius_m
        within = self._body.gap_m(obstacles.points_m[near]) < 0.0
        return int(within.sum()) >= self._settings.min_points

    def _slowdown_zone(self, obstacles: Obstacles) -> tuple[Reason, ...]:
        settings = self._settings
        if settings.slowdown_radius == 0.0:
            return _NO_REASON
        near = np.hypot(*obstacles.points_m.T) < settings.slowdown_radius
        reach_m = settings.slowdown_radius + settings.person_radius
        near_people = np.hypot(*obstacles.people_m.T) < reach_m
        return _reasons(near_people.any(), near.sum() >= settings.min_points, Fault.NEAR)

    def _collisions(
        self,
        command: Command,
        speeds: tuple[float, float],
        obstacles: Obstacles,
        *,
        leaves: bool = False,
    ) -> tuple[Reason, ...]:
        """Which obstacles forbid a command; none do where a round robot only turns.

        leaves: scan points may come as near as the nearest one is, but no deeper all in all.
        """
        path = self._path(command, speeds)
        if path.swept_m == 0.0:
            return _NO_REASON
        settings, body, margin_m = self._settings, self._body, self._settings.collision_margin
        unknown: tuple[Reason, ...] = ()
        if len(obstacles.unknown_m):
            known = replace(obstacles, points_m=obstacles.unknown_m, points_mps=0.0)
            if self._comes_near_points(path, known, body, margin_m):
                unknown = (Reason(Source.SCAN, Fault.UNKNOWN),)
        hit = self._comes_near_points(path, obstacles, body, margin_m, leaves=leaves)
        if settings.stop_radius > 0.0 and path.length_m > 0.0 and not hit:
            start = replace(path, poses=path.poses[:1], time_s=path.time_s[:1])
            hit = self._comes_near_points(start, obstacles, self._stop_zone, 0.0)
        return _reasons(self._comes_near_people(path, obstacles), hit, Fault.COLLISION) + unknown

    def _path(self, command: Command, speeds: tuple[float, float]) -> _Path:
        """The path of a robot that follows the command for a while and then brakes."""
        step_s, turns = self._step_s, not self._body.is_round
        speed, turn = speeds
        x_m = y_m = yaw_rad = length_m = turned_rad = 0.0
        poses: list[Pose] = []
        while len(poses) < self._n_follow or speed != 0.0 or (turns and turn != 0.0):
            wanted = command if len(poses) < self._n_follow else STOP
            speed, turn = limited_velocity(wanted, speed, turn, self._robot, step_s)
            middle = yaw_rad + 0.5 * turn * step_s
            x_m += speed * step_s * math.cos(middle)
            y_m += speed * step_s * math.sin(middle)
            yaw_rad += turn * step_s
            length_m += abs(speed) * step_s
            turned_rad += abs(turn) * step_s
            poses.append((x_m, y_m, yaw_rad))
        time_s: FloatArray = step_s * np.arange(1, len(poses) + 1, dtype=np.float64)
        swept_m = length_m + (self._body.radius_m * turned_rad if turns else 0.0)
        path = _Path(np.array(poses), time_s, length_m, swept_m)
        return self._refined(path) if turns else path

    def _refined(self, path: _Path) -> _Path:
        """The path with more poses, between which no corner moves far."""
        time_s = np.append(0.0, path.time_s)
        poses = np.concatenate([np.zeros((1, 3)), path.poses])
        moved = np.abs(np.diff(poses, axis=0))
        corner_m = np.append(0.0, np.hypot(*moved.T[:2]) + self._body.radius_m * moved[:, 2])
        along_m = corner_m.cumsum()
        fine_m = np.linspace(0.0, along_m[-1], 2 + int(path.swept_m / _FINE_M))
        columns = [np.interp(fine_m, along_m, column) for column in (*poses.T, time_s)]
        return replace(path, poses=np.stack(columns[:3], axis=1), time_s=columns[3])

    def _comes_near_points(
        self,
        path: _Path,
        obstacles: Obstacles,
        body: Footprint,
        margin_m: float,
        *,
        leaves: bool = False,
    ) -> bool:
        """Whether enough scan points come within the margin, or nearer than they are."""
        margins_m = margin_m + obstacles.points_mps * path.time_s[:, None]
        standing_m = body.gap_m(obstacles.points_m)
        near = standing_m < margins_m[-1] + path.swept_m
        standing_m = standing_m[near]
        if len(standing_m) < self._settings.min_points:
            return False
        gap_m = body.gaps_m(path.poses, obstacles.points_m[near], float(margins_m[-1, 0]))
        # Along a wall that is nearer than the margin, the robot may keep its distance to it. A
        # corner that turns to it may not: by noise it would come nearer scan by scan.
        nearest_m = float(standing_m.min()) if path.length_m > 0.0 else math.inf
        kept_m = np.minimum(nearest_m if leaves else max(nearest_m, 0.0), margins_m)
        limit_m = np.minimum(standing_m, kept_m) - _ROUNDING_M
        comes_near = int((gap_m < limit_m).any(axis=0).sum()) >= self._settings.min_points
        return comes_near or (leaves and _goes_deeper(standing_m, gap_m))

    def _comes_near_people(self, path: _Path, obstacles: Obstacles) -> bool:
        """Whether a person comes within the margin, and nearer than to a robot that stands."""
        if not len(obstacles.people_m):
            return False
        settings, body = self._settings, self._body
        reach_m = body.radius_m + settings.person_radius
        speed_mps = np.hypot(obstacles.people_mps[:, 0], obstacles.people_mps[:, 1])
        away_m = np.hypot(obstacles.people_m[:, 0], obstacles.people_m[:, 1])
        range_m = reach_m + settings.collision_margin + path.swept_m
        near = away_m < range_m + speed_mps * path.time_s[-1]
        if not near.any():
            return False
        moved_m = obstacles.people_mps[near, None] * path.time_s[:, None]
        later_m = obstacles.people_m[near, None] + moved_m
        later_m = np.swapaxes(later_m, 0, 1)  # (times, people, 2)
        standing_m, gap_m = (
            body.gaps_m(poses, later_m, settings.collision_margin + settings.person_radius)
            - settings.person_radius
            for poses in (np.zeros_like(path.poses), path.poses)
        )
        limit_m = np.minimum(settings.collision_margin, standing_m - _ROUNDING_M)
        return bool((gap_m < limit_m).any())


def _goes_deeper(standing_m: FloatArray, gap_m: FloatArray) -> bool:
    """Whether points (N,) come deeper into the footprint on a path (times, N), all in all.

    A single point would not do: by its noise the robot would come nearer scan by scan.
    """
    now_m, later_m = (np.maximum(-each, 0.0).sum(axis=-1) for each in (standing_m, gap_m))
    return bool((later_m > now_m + _ROUNDING_M).any())


def _scaled(command: Command, share: float) -> Command:
    if share == 1.0:
        return command
    return Command(share * command.linear_mps, share * command.angular_radps)


def _reasons(people: object, points: object, fault: Fault) -> tuple[Reason, ...]:
    found = (Source.PEOPLE, people), (Source.SCAN, points)
    return tuple(Reason(source, fault) for source, is_so in found if is_so)
