"""The guard between what drives and the robot: a function of the newest inputs and the time.

Each input is received with its stamp; `step` returns the command that may reach the robot. Input
rules come first (`input_monitor`), then the collision monitor. A driver who holds the override
bypasses both; a command that is old or not finite is a stop in every case.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray
from sim.planning.nearby_people import distance_to_nearest
from sim.safety.collision_monitor import CollisionMonitor, Obstacles
from sim.safety.input_monitor import (
    Check,
    OdometryMonitor,
    PeopleMonitor,
    PoseMonitor,
    ScanMonitor,
    StampMonitor,
)
from sim.safety.motion import Pose, is_finite, motion_between
from sim.safety.reasons import Fault, GuardAction, Reason, Source
from sim.safety.scan import Scan
from sim.safety.settings import GuardSettings
from sim.world.command import STOP, Command

#: Scan points nearer than this (m) to the body of a person belong to that person.
_BODY_MARGIN_M = 0.15
_MOST_WAITING = 200
_PEOPLE_UNKNOWN = Fault.FROZEN, Fault.INVALID, Fault.UNSEEN


@dataclass(frozen=True)
class GuardOutput:
    """The command for the robot, what was done to it, and why.

    overridden: a driver held the override, so the reasons did not change the command.
    """

    command: Command
    action: GuardAction
    reasons: tuple[Reason, ...] = ()
    overridden: bool = False


class _Rule(Protocol):
    def check(self) -> Check: ...


@dataclass(frozen=True, eq=False)
class _People:
    stamp_s: float
    position_m: FloatArray
    velocity_mps: FloatArray


class Guard:
    """Receives inputs and returns commands; it has no clock of its own."""

    def __init__(self, settings: GuardSettings | None = None) -> None:
        self.settings = settings if settings is not None else GuardSettings()
        self.n_rejected: Counter[Source] = Counter()
        self._monitor = CollisionMonitor(self.settings)
        observed = map(Source, self.settings.observation_sources)
        self.sources = (Source.ODOMETRY, *observed)
        self._reach_m = _reach_m(self.settings)
        at = self.settings
        self._sensor: Pose = at.sensor_x, at.sensor_y, at.sensor_yaw
        self._now_s: float | None = None
        self._override_s: float | None = None
        self.reset()

    def reset(self) -> None:
        """Discard all inputs, at the start of a session."""
        settings = self.settings
        self._stamps = {source: StampMonitor(settings) for source in self.sources}
        self._odometry, self._crowd = OdometryMonitor(settings), PeopleMonitor(settings)
        track = self._odometry.track
        self._poses, self._scans = PoseMonitor(settings, track), ScanMonitor(settings, track)
        self._rules: dict[Source, _Rule] = {
            Source.ODOMETRY: self._odometry,
            Source.POSE: self._poses,
            Source.PEOPLE: self._crowd,
            Source.SCAN: self._scans,
        }
        self._waiting_poses: deque[tuple[float, Pose]] = deque(maxlen=_MOST_WAITING)
        self._waiting_scans: deque[Scan] = deque(maxlen=_MOST_WAITING)
        self._pose: tuple[float, Pose] | None = None
        self._people: _People | None = None
        self._scan: tuple[FloatArray, Pose, float] | None = None
        self._command: tuple[float, Command] | None = None
        self._override_s = None

    def receive_odometry(self, stamp_s: float, pose: Pose, speeds: tuple[float, float]) -> None:
        """Take the pose by the wheels and the speeds (m/s, rad/s)."""
        if self._accepts(Source.ODOMETRY, stamp_s, is_finite((*pose[:2], pose[2] + sum(speeds)))):
            # A quaternion does not keep the last bits of an angle.
            self._odometry.take(stamp_s, (*pose[:2], float(np.float32(pose[2]))), speeds)

    def receive_pose(self, stamp_s: float, pose: Pose) -> None:
        """Take the pose of the robot in the map."""
        if self._accepts(Source.POSE, stamp_s, is_finite(pose)):
            self._pose = stamp_s, (*pose[:2], float(np.float32(pose[2])))
            self._waiting_poses.append(self._pose)

    def receive_people(
        self, stamp_s: float, position_m: ArrayLike, velocity_mps: ArrayLike
    ) -> None:
        """Take positions and velocities (N, 2) of people in the map."""
        position = np.asarray(position_m, dtype=np.float64).reshape(-1, 2)
        velocity = np.asarray(velocity_mps, dtype=np.float64).reshape(-1, 2)
        if self._accepts(Source.PEOPLE, stamp_s, len(position) == len(velocity)):
            self._people = _People(stamp_s, position, velocity)
            self._crowd.take(position, velocity)

    def receive_scan(self, scan: Scan) -> None:
        """Take a scan."""
        valid = scan.geometry.is_finite and len(scan.ranges_m) > 0
        if self._accepts(Source.SCAN, scan.stamp_s, valid):
            self._waiting_scans.append(scan)

    def receive_command(self, stamp_s: float, command: Command) -> None:
        """Take the command of what drives; one that is not finite is a stop."""
        if not command.is_finite:
            self.n_rejected[Source.COMMAND] += 1
        self._command = stamp_s, command

    def receive_override(self, now_s: float, held: bool) -> None:
        """Take whether a driver holds the override now."""
        self._override_s = now_s if held else None

    def command_age_s(self, now_s: float) -> float:
        """Age of the newest command; inf without one."""
        return math.inf if self._command is None else now_s - self._command[0]

    def ages_s(self, now_s: float) -> dict[Source, float]:
        """Age of each input by its newest stamp, inf for one that never came."""
        return {
            source: math.inf if each.shown_s is None else now_s - each.shown_s
            for source, each in self._stamps.items()
        }

    def step(self, now_s: float) -> GuardOutput:
        """The command for now."""
        self.advance(now_s)
        self._assess()
        fault = self._command_fault(now_s)
        if fault is not None:
            return GuardOutput(STOP, GuardAction.STOP, (Reason(Source.COMMAND, fault),))
        assert self._command is not None
        output = self._guarded(now_s, self._command[1])
        if not self._is_overridden(now_s):
            return output
        return GuardOutput(self._command[1], GuardAction.DO_NOTHING, output.reasons, True)

    def _accepts(self, source: Source, stamp_s: float, valid: bool) -> bool:
        monitor = self._stamps.get(source)
        if monitor is None:
            return False
        now_s = math.inf if self._now_s is None else self._now_s
        accepted = valid and math.isfinite(stamp_s) and monitor.accepts(stamp_s, now_s)
        if not accepted:
            self.n_rejected[source] += 1
        return accepted

    def advance(self, now_s: float) -> None:
        """Set the clock, before the inputs of that time are received.

        A clock that goes back begins a new session; after a gap, motions begin anew.
        """
        last_s, self._now_s = self._now_s, now_s
        if last_s is None:
            return
        if now_s < last_s:
            self.reset()
        elif now_s - last_s > self.settings.clock_jump:
            self._odometry.begin_session()
            self._poses.begin_session()
            for monitor in self._stamps.values():
                monitor.begin_session()

    def _assess(self) -> None:
        """Take the poses and scans that waited for odometry."""
        track = self._odometry.track
        if not len(track):
            return
        while self._waiting_poses:
            stamp_s, pose = self._waiting_poses.popleft()
            self._poses.take(stamp_s, pose, track.at(stamp_s))
            if self._poses.has_leapt and Source.SCAN in self.sources:
                self._crowd.doubt(stamp_s)
        while self._waiting_scans:
            scan = self._waiting_scans.popleft()
            odometry = track.at(scan.stamp_s)
            self._scans.take(scan)
            self._scan = self._points(scan), odometry, scan.stamp_s
            self._compare_people(scan, odometry)

    def _compare_people(self, scan: Scan, odometry: Pose) -> None:
        people = self._people
        if people is None or self._pose is None:
            return
        stamp_s, pose = self._pose
        moved = motion_between(self._odometry.track.at(stamp_s), odometry)
        walked_m = (scan.stamp_s - people.stamp_s) * people.velocity_mps
        place_m = in_frame(in_frame(people.position_m + walked_m, pose), moved)
        self._crowd.compare(scan, in_frame(place_m, self._mount_of(scan)))

    def _mount_of(self, scan: Scan) -> Pose:
        return self._sensor if scan.mount is None else scan.mount

    def _points(self, scan: Scan) -> FloatArray:
        """(N, 2) points near the robot, in its frame at the time of the scan."""
        x_m, y_m, yaw_rad = self._mount_of(scan)
        points_m = scan.points_within(self._reach_m + math.hypot(x_m, y_m))
        if yaw_rad != 0.0:
            points_m = _rotated(points_m, yaw_rad)
        offset_m: FloatArray = np.array([x_m, y_m])
        return points_m + offset_m

    def _command_fault(self, now_s: float) -> Fault | None:
        if self._command is None:
            return Fault.MISSING
        stamp_s, command = self._command
        if not command.is_finite:
            return Fault.INVALID
        if now_s - stamp_s > self.settings.command_timeout:
            return Fault.STALE
        return Fault.FUTURE if stamp_s - now_s > self.settings.transform_tolerance else None

    def _is_overridden(self, now_s: float) -> bool:
        if self._override_s is None:
            return False
        return 0.0 <= now_s - self._override_s <= self.settings.override_timeout

    def _guarded(self, now_s: float, command: Command) -> GuardOutput:
        checks = {source: self._check(source, now_s) for source in self.sources}
        reasons = tuple(Reason(source, fault) for source, (_, fault) in checks.items() if fault)
        ignored = self._ignored_people(checks)
        relied = [each for each in self.sources if each is not Source.PEOPLE or not ignored]
        share = min(checks[source][0] for source in relied)
        if share <= 0.0:
            return GuardOutput(STOP, GuardAction.STOP, reasons)
        allowed, action = self._limited(command, share, slowly=ignored)
        obstacles = self._obstacles(now_s, with_people=not ignored)
        allowed, done, found = self._monitor.step(allowed, self._odometry.speeds, obstacles)
        return GuardOutput(allowed, done if found else action, reasons + found)

    def _check(self, source: Source, now_s: float) -> Check:
        """The stricter of what age and content of an input allow."""
        by_age = self._stamps[source].check(now_s)
        if by_age[0] <= 0.0:
            return by_age
        by_content = self._rules[source].check()
        return by_content if by_content[0] < by_age[0] else by_age

    def _ignored_people(self, checks: dict[Source, Check]) -> bool:
        """Whether the people are known to be wrong, and the scan shows them instead."""
        if Source.PEOPLE not in checks or checks[Source.PEOPLE][1] not in _PEOPLE_UNKNOWN:
            return False
        return Source.SCAN in checks and checks[Source.SCAN][0] > 0.0

    def _limited(
        self, command: Command, share: float, *, slowly: bool
    ) -> tuple[Command, GuardAction]:
        settings = self.settings
        fastest = share * settings.max_vel_x
        action = GuardAction.SLOWDOWN
        if slowly and settings.linear_limit < fastest:
            fastest, action = settings.linear_limit, GuardAction.LIMIT
        speed, turn = abs(command.linear_mps), abs(command.angular_radps)
        factor = min(
            1.0,
            fastest / max(speed, 1e-9),
            share * settings.max_vel_theta / max(turn, 1e-9),
        )
        if factor == 1.0 or (share == 1.0 and not slowly):
            return command, GuardAction.DO_NOTHING
        return Command(factor * command.linear_mps, factor * command.angular_radps), action

    def _obstacles(self, now_s: float, *, with_people: bool) -> Obstacles:
        """Scan points and people in the robot's frame; points of known people are left out."""
        nothing = np.zeros((0, 2))
        people_m = people_mps = points_m = nothing
        if self._scan is not None:
            points_m, scanned_at, _ = self._scan
            points_m = in_frame(points_m, motion_between(scanned_at, self._odometry.track.pose))
        if not with_people:
            return Obstacles(points_m, people_m, people_mps, self.settings.person_speed)
        if self._people is None or self._pose is None:
            return Obstacles(points_m, people_m, people_mps)
        people, (_, pose) = self._people, self._pose
        place_m = in_frame(people.position_m, pose)
        near = np.hypot(place_m[:, 0], place_m[:, 1]) < 2.0 * self._reach_m
        place_m = place_m[near]
        velocity_mps = _rotated(people.velocity_mps[near], -pose[2])
        if len(points_m) and len(place_m):
            assert self._scan is not None
            then_m = place_m + (self._scan[2] - people.stamp_s) * velocity_mps
            from_m, to_m = (points_m[:, 0], points_m[:, 1]), (then_m[:, :1], then_m[:, 1:])
            away_m = distance_to_nearest(*from_m, *to_m)
            points_m = points_m[away_m > self.settings.person_radius + _BODY_MARGIN_M]
        return Obstacles(points_m, place_m + (now_s - people.stamp_s) * velocity_mps, velocity_mps)


def _reach_m(settings: GuardSettings) -> float:
    """How far (m) from the centre a point can matter."""
    speed, slow = settings.max_vel_x, min(settings.linear_limit, settings.max_vel_x)
    follows_s = settings.reaction_time + 2.0 / settings.controller_frequency
    old_m = speed * settings.source_timeout
    walked_m = settings.person_speed * (follows_s + slow / settings.braking)
    zones_m = max(settings.radius + settings.collision_margin, settings.stop_radius)
    return old_m + max(
        zones_m + speed * follows_s + 0.5 * speed**2 / settings.braking,
        zones_m + slow * follows_s + 0.5 * slow**2 / settings.braking + walked_m,
        settings.slowdown_radius,
    )


def in_frame(points_m: FloatArray, frame: Pose) -> FloatArray:
    """(N, 2) points in the frame of a pose."""
    return _rotated(points_m, -frame[2], frame[:2])


def _rotated(
    vectors: FloatArray, angle_rad: float, centre: tuple[float, float] = (0.0, 0.0)
) -> FloatArray:
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    x, y = vectors[:, 0] - centre[0], vectors[:, 1] - centre[1]
    turned: FloatArray = np.empty((len(vectors), 2))
    turned[:, 0], turned[:, 1] = cos * x - sin * y, sin * x + cos * y
    return turned
