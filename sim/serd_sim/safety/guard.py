"""The guard between what drives and the robot: a function of the newest inputs and the time.

Each input is received with its stamp; `step` returns the command that may reach the robot. Input
rules come first (`input_monitor`), then the collision monitor. A driver who holds the override
bypasses both; a command that is old or not finite is a stop in every case.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray
from serd_sim.errors import SimError
from serd_sim.planning.rollout_costs import distance_to_nearest
from serd_sim.safety.collision_monitor import CollisionMonitor, Obstacles
from serd_sim.safety.input_monitor import (
    Check,
    OdometryMonitor,
    PeopleMonitor,
    PoseMonitor,
    ScanMonitor,
    StampMonitor,
)
from serd_sim.safety.known_space import BODY_MARGIN_M, NO_POINTS, KnownSpace, SeenSpace
from serd_sim.safety.motion import Pose, compose, in_frame, is_finite, motion_between, rotated
from serd_sim.safety.reasons import Fault, GuardAction, Reason, Source
from serd_sim.safety.scan import Scan
from serd_sim.safety.settings import CREEP_MPS, GuardSettings
from serd_sim.world.command import STOP, Command

_MOST_WAITING = 200
#: A clock that advances more than this (s) at once begins a new session.
_CLOCK_JUMP_S = 1.0
#: The robot stands below these speeds.
_STANDS_MPS, _STANDS_RADPS = 0.02, 0.05
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


@dataclass(frozen=True, eq=False)
class _People:
    stamp_s: float
    position_m: FloatArray
    velocity_mps: FloatArray


class Guard:
    """Receives inputs and returns commands; it has no clock of its own.

    walls_m: (W, 2, 2) segments of the map, in whose reach a ray must have a return; None without
    a map.
    """

    def __init__(
        self, settings: GuardSettings | None = None, walls_m: FloatArray | None = None
    ) -> None:
        self.settings = settings if settings is not None else GuardSettings()
        self.n_rejected: Counter[Source] = Counter()
        observed = map(Source, self.settings.observation_sources)
        self.sources = (Source.ODOMETRY, *observed)
        self._space = KnownSpace(self.settings, walls_m, 0.0)
        self._now_s: float | None = None
        self._override_s: float | None = None
        self.reset()

    def reset(self) -> None:
        """Discard all inputs, at the start of a session."""
        settings = self.settings
        self._stamps = {source: StampMonitor(settings) for source in self.sources}
        self._odometry, self._crowd = OdometryMonitor(settings), PeopleMonitor(settings)
        track = self._odometry.track
        self._poses = PoseMonitor(settings, track)
        self._space.begin_session()
        self._scans = ScanMonitor(settings, track, self._space)
        self._rules: dict[Source, OdometryMonitor | PoseMonitor | PeopleMonitor | ScanMonitor] = {
            Source.ODOMETRY: self._odometry,
            Source.POSE: self._poses,
            Source.PEOPLE: self._crowd,
            Source.SCAN: self._scans,
        }
        self._waiting_poses: deque[tuple[float, Pose]] = deque(maxlen=_MOST_WAITING)
        self._waiting_scans: deque[Scan] = deque(maxlen=_MOST_WAITING)
        self._pose: tuple[float, Pose] | None = None
        self._people: _People | None = None
        #: What the newest scan shows, the pose by odometry at its stamp, and the stamp.
        self._scan: tuple[SeenSpace, Pose, float] | None = None
        self._command: tuple[float, Command] | None = None
        self._override_s = None
        self.change(settings)

    def require_may_change(self, settings: GuardSettings, now_s: float) -> None:
        """SimError where settings would allow more than the present ones and the robot drives."""
        names = self.settings.loosened(settings)
        if not names or self._stands(now_s):
            return
        speed, turn = self._odometry.speeds
        raise SimError(
            f"{', '.join(names)} may allow more only while the robot stands by a fresh odom, which"
            f" shows {speed:.2f} m/s and {turn:.2f} rad/s; stop it, then set it again"
        )

    def _stands(self, now_s: float) -> bool:
        speed, turn = self._odometry.speeds
        is_fresh = self._stamps[Source.ODOMETRY].check(now_s)[0] > 0.0
        return is_fresh and abs(speed) < _STANDS_MPS and abs(turn) < _STANDS_RADPS

    def change(self, settings: GuardSettings) -> None:
        """Guard by other settings from now on.

        What is plausible for odometry and pose stays what it was by the first ones, so that a
        robot whose speed has just been limited does not jump.
        """
        self.settings = settings
        self._monitor, self._reach_m = CollisionMonitor(settings), _reach_m(settings)
        self._space.settings, self._space.reach_m = settings, self._reach_m
        self._scans.settings = settings
        for monitor in self._stamps.values():
            monitor.settings = settings

    def receive_odometry(self, stamp_s: float, pose: Pose, speeds: tuple[float, float]) -> None:
        """Take the pose by the wheels and the speeds (m/s, rad/s)."""
        if self._accepts(Source.ODOMETRY, stamp_s, is_finite((*pose[:2], pose[2] + sum(speeds)))):
            # A quaternion does not keep the last bits of an angle.
            self._odometry.take(stamp_s, (*pose[:2], float(np.float32(pose[2]))), speeds)
            if self._odometry.has_leapt:
                self._space.begin_session()

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
        if self._accepts(Source.SCAN, scan.stamp_s, scan.is_usable):
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
        elif now_s - last_s > _CLOCK_JUMP_S:
            self._odometry.begin_session()
            self._poses.begin_session()
            self._space.begin_session()
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
            raw = self._waiting_scans.popleft()
            odometry = track.at(raw.stamp_s)
            people_m, in_map = self._people_around(raw.stamp_s, odometry)
            scan = self._scans.take(raw, odometry, people_m, in_map)
            self._scan = self._scans.seen, odometry, scan.stamp_s
            if self._people is not None and in_map is not None:
                self._crowd.compare(scan, in_frame(people_m, self._scans.mount_of(scan)))

    def _people_around(self, stamp_s: float, odometry: Pose) -> tuple[FloatArray, Pose | None]:
        """People (P, 2) in the robot's frame at the stamp of a scan, and its pose in the map."""
        if self._pose is None:
            return NO_POINTS, None
        posed_s, pose = self._pose
        moved = motion_between(self._odometry.track.at(posed_s), odometry)
        people, in_map = self._people, compose(pose, moved)
        if people is None:
            return NO_POINTS, in_map
        walked_m = (stamp_s - people.stamp_s) * people.velocity_mps
        return in_frame(in_frame(people.position_m + walked_m, pose), moved), in_map

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
        if not self._is_in_view(command):
            share = min(share, CREEP_MPS / self.settings.max_vel_x)
            reasons += (Reason(Source.SCAN, Fault.NOT_IN_VIEW),)
        allowed, action = self._limited(command, share, slowly=ignored)
        fastest = self.settings.max_vel_x, self.settings.max_vel_theta
        if abs(command.linear_mps) > fastest[0] or abs(command.angular_radps) > fastest[1]:
            reasons += (Reason(Source.COMMAND, Fault.FAST),)
        obstacles = self._obstacles(now_s, with_people=not ignored)
        allowed, done, found = self._monitor.step(allowed, self._odometry.speeds, obstacles)
        return GuardOutput(allowed, done if found else action, reasons + found)

    def _is_in_view(self, command: Command) -> bool:
        """Whether the lidar, where there is one, looks where a command leads."""
        if self._scan is None:
            return True
        seen = self._scan[0]
        if command.linear_mps == 0.0:
            return seen.around or command.angular_radps == 0.0 or self.settings.outline.is_round
        return seen.ahead if command.linear_mps > 0.0 else seen.behind

    def _check(self, source: Source, now_s: float) -> Check:
        """The stricter of what age and content of an input allow."""
        by_age = self._stamps[source].check(now_s)
        if by_age[0] <= 0.0:
            return by_age
        by_content = self._rules[source].check()
        is_sound = by_content[1] is None or (by_age[1] is not None and by_age[0] <= by_content[0])
        return by_age if is_sound else by_content

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
        action = GuardAction.SLOWDOWN if share < 1.0 else GuardAction.LIMIT
        if slowly and settings.linear_limit < fastest:
            fastest, action = settings.linear_limit, GuardAction.LIMIT
        speed, turn = abs(command.linear_mps), abs(command.angular_radps)
        factor = min(
            1.0, fastest / max(speed, 1e-9), share * settings.max_vel_theta / max(turn, 1e-9)
        )
        if factor == 1.0:
            return command, GuardAction.DO_NOTHING
        return Command(factor * command.linear_mps, factor * command.angular_radps), action

    def _obstacles(self, now_s: float, *, with_people: bool) -> Obstacles:
        """Scan points and people in the robot's frame; points of known people are left out."""
        people_m = people_mps = points_m = unknown_m = NO_POINTS
        if self._scan is not None:
            seen, scanned_at, _ = self._scan
            moved = motion_between(scanned_at, self._odometry.track.pose)
            points_m, unknown_m = in_frame(seen.points_m, moved), in_frame(seen.unknown_m, moved)
        if not with_people:
            speed_mps = self.settings.person_speed
            return Obstacles(points_m, people_m, people_mps, speed_mps, unknown_m)
        if self._people is None or self._pose is None:
            return Obstacles(points_m, people_m, people_mps, unknown_m=unknown_m)
        people, (_, pose) = self._people, self._pose
        place_m = in_frame(people.position_m, pose)
        near = np.hypot(place_m[:, 0], place_m[:, 1]) < 2.0 * self._reach_m
        place_m = place_m[near]
        velocity_mps = rotated(people.velocity_mps[near], -pose[2])
        if len(points_m) and len(place_m):
            assert self._scan is not None
            then_m = place_m + (self._scan[2] - people.stamp_s) * velocity_mps
            away_m = distance_to_nearest(points_m[:, 0], points_m[:, 1], then_m[..., None])
            points_m = points_m[away_m > self.settings.person_radius + BODY_MARGIN_M]
        people_m = place_m + (now_s - people.stamp_s) * velocity_mps
        return Obstacles(points_m, people_m, velocity_mps, unknown_m=unknown_m)


def _reach_m(settings: GuardSettings) -> float:
    """How far (m) from the centre a point can matter."""
    speed, slow = settings.max_vel_x, min(settings.linear_limit, settings.max_vel_x)
    follows_s = settings.reaction_time + 2.0 / settings.controller_frequency
    old_m = speed * settings.source_timeout
    walked_m = settings.person_speed * (follows_s + slow / settings.braking)
    zones_m = max(settings.outline.radius_m + settings.collision_margin, settings.stop_radius)
    return old_m + max(
        zones_m + speed * follows_s + 0.5 * speed**2 / settings.braking,
        zones_m + slow * follows_s + 0.5 * slow**2 / settings.braking + walked_m,
        settings.slowdown_radius,
    )
