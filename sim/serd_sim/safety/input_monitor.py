"""Age, rate and plausibility of the inputs; times are stamps on the clock of the robot.

An input that is old, slow or partly lost lowers the allowed share of the speed, from 1 to 0; a
fault that means that an input is wrong sets it to 0. A fault ends with evidence: another scan,
another pose that follows odometry. It does not end with time.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.safety.known_space import NO_POINTS, KnownSpace, SeenSpace
from serd_sim.safety.motion import Pose, PoseTrack, motion_between
from serd_sim.safety.reasons import Fault
from serd_sim.safety.scan import Scan, shown_by
from serd_sim.safety.settings import CREEP_MPS, GuardSettings

#: Share of the speed that an input allows, and the fault where it is below 1.
Check = tuple[float, Fault | None]
_SOUND: Check = 1.0, None
_PERIOD_WEIGHT = 0.25
_EARLY_S = 1e-9
_WALKS_MPS = 0.05
#: Error (m) allowed between the motions of twist and pose, and how late (s) a twist may be.
_TWIST_ERROR_M, _TWIST_LAG_S = 0.15, 0.2
#: Time (s) over which motions are compared, and for which a pose must be consistent after a jump.
_WINDOW_S, _SECOND_LOOK_S = 2.0, 1.0
#: Poses of a slow robot are compared over as long, until it has moved by as many tolerances.
_SLOW_WINDOW_S, _TOLERANCES = 10.0, 2.0
#: Messages with the same people, some of them walking, that are frozen.
_FROZEN_MESSAGES = 3
#: Share of people in view whom the scan does not show, from which they are wrong, and for how long
#: (s) it must show all of them then, or after a jump of the pose.
_UNSEEN_PEOPLE, _PEOPLE_LOOK_S = 0.05, 10.0
#: Longest stand (s) after a twist or a pose that was wrong again.
_LONGEST_LOOK_S = 60.0
#: A pose shows another speed than the twist from this difference (m/s, and share) on.
_OTHER_MPS, _OTHER = 0.2, 0.2
#: Factor on the largest speed beyond which a motion of odometry is a jump.
_JUMP_RATIO = 1.5


class StampMonitor:
    """Age and rate of one input.

    A message from the future counts as none, since sound ones would not be newer for as long.
    settings: may be replaced.
    """

    def __init__(self, settings: GuardSettings) -> None:
        self.settings = settings
        self._period_s = 0.0
        self._previous_s: float | None = None
        self.stamp_s: float | None = None
        self._future_s: float | None = None

    @property
    def shown_s(self) -> float | None:
        """The newest stamp, also one from the future."""
        return self.stamp_s if self._future_s is None else self._future_s

    def accepts(self, stamp_s: float, now_s: float) -> bool:
        """Take a stamp that is newer than the last one; others are no message.

        One from the future is a fault until a sound one comes.
        """
        if stamp_s - now_s > self.settings.transform_tolerance:
            self._future_s = stamp_s
            return False
        if self.stamp_s is not None and stamp_s <= self.stamp_s:
            return False
        if self._previous_s is not None:
            gap_s = stamp_s - self._previous_s
            weight = _PERIOD_WEIGHT if self._period_s else 1.0
            self._period_s += weight * (gap_s - self._period_s)
        self.stamp_s = self._previous_s = stamp_s
        self._future_s = None
        return True

    def begin_session(self) -> None:
        """Discard the rate, after a gap in the clock."""
        self._period_s, self._previous_s = 0.0, None

    def check(self, now_s: float) -> Check:
        """What age and rate allow."""
        if self._future_s is not None:
            return 0.0, Fault.FUTURE
        if self.stamp_s is None:
            return 0.0, Fault.MISSING
        settings, age_s = self.settings, now_s - self.stamp_s
        if age_s >= settings.source_timeout - _EARLY_S:
            return 0.0, Fault.STALE
        age_s = max(age_s, min(self._period_s, settings.source_timeout))
        span_s = settings.source_timeout - settings.slowdown_timeout
        share = min((settings.source_timeout - age_s) / span_s, 1.0)
        return share, Fault.SLOW if share < 1.0 - _EARLY_S else None


class FrozenMonitor:
    """Whether a value has stayed the same, bit for bit, while odometry moved.

    Only poses of odometry between the first and the newest stamp of the value count. The robot may
    have moved before, and a reset of odometry beside a new value is no motion: were it counted, a
    robot that stands in a world without motion would never receive the value that ends the fault.
    """

    def __init__(self, settings: GuardSettings, track: PoseTrack) -> None:
        self._limit_m, self._radius_m = settings.frozen_motion, settings.outline.radius_m
        self._track = track
        self._value: bytes | None = None
        self._first_s = self._newest_s = 0.0
        self._since: tuple[float, Pose] | None = None
        self._is_frozen = False

    def take(self, stamp_s: float, value: bytes) -> None:
        """Take a value."""
        if value != self._value:
            self._value, self._first_s, self._since = value, stamp_s, None
            self._is_frozen = False
        self._newest_s = stamp_s

    def is_frozen(self) -> bool:
        """Whether the value is frozen; it stays so until another one comes."""
        self._is_frozen = self._is_frozen or self._motion_m() > self._limit_m
        return self._is_frozen

    def _motion_m(self) -> float:
        if self._value is not None and self._since is None:
            self._since = self._track.first_since(self._first_s)
        now = self._track.last_until(self._newest_s)
        if self._since is None or now is None or now[0] <= self._since[0]:
            return 0.0
        x_m, y_m, turn = motion_between(self._since[1], now[1])
        return math.hypot(x_m, y_m) + self._radius_m * abs(turn)


class _Posed(NamedTuple):
    """A pose, that by odometry, and way and turn by odometry until then, without a sign."""

    stamp_s: float
    pose: Pose
    odometry: Pose
    way_m: float = 0.0
    turned_rad: float = 0.0


class PoseMonitor:
    """Compares the motion of the pose with that of odometry.

    A robot that stands shows nothing of its pose: each time that it contradicts again, before the
    robot has moved by some tolerances, it stands for twice as long.
    """

    def __init__(self, settings: GuardSettings, track: PoseTrack) -> None:
        self._settings = settings
        self._frozen = FrozenMonitor(settings, track)
        self._window: deque[_Posed] = deque()
        self._fault: Fault | None = None
        self._faulty_since_s, self._stands_s, self._look_s = 0.0, 0.0, _SECOND_LOOK_S
        #: Whether the newest pose is another place than speed can explain.
        self.has_leapt = False

    def begin_session(self) -> None:
        """Discard what the pose was, after a gap in the clock."""
        self._window.clear()

    def take(self, stamp_s: float, pose: Pose, odometry: Pose) -> None:
        """Take a pose, and the pose by odometry at its stamp."""
        self._frozen.take(stamp_s, np.array(pose).tobytes())
        last = self._window[-1] if self._window else _Posed(stamp_s, pose, odometry)
        self.has_leapt = _leaps(last.pose, pose, stamp_s - last.stamp_s, self._settings)
        x_m, y_m, turn = motion_between(last.odometry, odometry)
        way_m, turned_rad = last.way_m + math.hypot(x_m, y_m), last.turned_rad + abs(turn)
        now = _Posed(stamp_s, pose, odometry, way_m, turned_rad)
        fault = self._contradiction(now)
        if fault is not None:
            self._window.clear()
            if fault is Fault.JUMP:
                self._stands_s = _SECOND_LOOK_S
            elif self._fault is None:
                self._stands_s = self._look_s
                self._look_s = min(2.0 * self._look_s, _LONGEST_LOOK_S)
            self._fault, self._faulty_since_s = fault, stamp_s
        elif stamp_s - self._faulty_since_s >= self._stands_s - _EARLY_S:
            self._fault = None
        self._window.append(now)
        if self._has_moved():
            self._look_s = _SECOND_LOOK_S
        while self._window[0].stamp_s < stamp_s - _SLOW_WINDOW_S or (
            self._window[0].stamp_s < stamp_s - _WINDOW_S and self._has_moved()
        ):
            self._window.popleft()

    def _has_moved(self) -> bool:
        """Whether the robot has moved, within the window, by more than what is tolerated."""
        first, now, settings = self._window[0], self._window[-1], self._settings
        return (
            now.way_m - first.way_m > _TOLERANCES * settings.pose_tolerance
            or now.turned_rad - first.turned_rad > _TOLERANCES * settings.yaw_tolerance
        )

    def check(self) -> Check:
        """What the pose allows; a contradiction lasts until the pose was consistent for a while."""
        return _stand_at(Fault.FROZEN if self._frozen.is_frozen() else self._fault)

    def _contradiction(self, now: _Posed) -> Fault | None:
        if not self._window:
            return None
        if not self._agree(self._window[-1], now):
            return Fault.JUMP
        return None if self._agree(self._window[0], now) else Fault.INCONSISTENT

    def _agree(self, start: _Posed, now: _Posed) -> bool:
        settings = self._settings
        x_m, y_m, turn = motion_between(start.pose, now.pose)
        wheels_x_m, wheels_y_m, wheels_turn = motion_between(start.odometry, now.odometry)
        error_m = math.hypot(x_m - wheels_x_m, y_m - wheels_y_m)
        error_rad = abs(math.remainder(turn - wheels_turn, math.tau))
        drift_m = settings.drift_ratio * (now.way_m - start.way_m)
        drift_rad = settings.drift_ratio * (now.turned_rad - start.turned_rad)
        return (
            error_m <= settings.pose_tolerance + drift_m
            and error_rad <= settings.yaw_tolerance + drift_rad
        )


class OdometryMonitor:
    """Compares the poses by the wheels with the speeds of the same messages.

    A jump that speed cannot explain, a speed without a motion, and a motion without its speed are
    faults. After the last, speeds count as wrong until the robot has moved as they state, no faster
    than it creeps: a robot that stands shows nothing of them. Each time that they are wrong again
    it stands for twice as long. speeds: those of the poses where the messages state others.
    """

    def __init__(self, settings: GuardSettings) -> None:
        self._settings = settings
        self.track = PoseTrack(2.0 * _WINDOW_S)
        self.speeds = self._stated = (0.0, 0.0)
        #: Whether the newest pose is another place than speed can explain.
        self.has_leapt = False
        self._stamp_s: float | None = None
        self._n_same = 0
        self._jumped_s: float | None = None
        #: Stamp; sums of way and turn by the speeds, by the poses, and of the way without a sign;
        #: speeds by the poses.
        self._window: deque[FloatArray] = deque()
        self._doubted_s: float | None = None
        self._look_s = _SECOND_LOOK_S

    def begin_session(self) -> None:
        """Discard the stamp of the last pose, after a gap in the clock."""
        self._stamp_s = None
        self._window.clear()

    def take(self, stamp_s: float, pose: Pose, speeds: tuple[float, float]) -> None:
        """Take a pose by the wheels and the speeds (m/s, rad/s)."""
        settings, self.has_leapt = self._settings, False
        if len(self.track) and self._stamp_s is not None:
            if _leaps(self.track.pose, pose, stamp_s - self._stamp_s, settings):
                self._jumped_s, self.has_leapt = stamp_s, True
                self._window.clear()
            same = pose == self.track.pose and abs(speeds[0]) > _WALKS_MPS
            self._n_same = self._n_same + 1 if same else 0
            self._compare(stamp_s, pose, speeds)
        else:
            self.speeds = speeds
        if self._jumped_s is not None and stamp_s - self._jumped_s >= _SECOND_LOOK_S:
            self._jumped_s = None
        self._stamp_s, self._stated = stamp_s, speeds
        self.track.append(stamp_s, pose)

    def _compare(self, stamp_s: float, pose: Pose, speeds: tuple[float, float]) -> None:
        """Compare the motions of the window by pose and by the mean speeds of each period."""
        assert self._stamp_s is not None
        settings, period_s = self._settings, stamp_s - self._stamp_s
        self.speeds = speeds
        if period_s > settings.source_timeout:  # the mean of two speeds says little
            self._window.clear()
            return
        x_m, _, turn = motion_between(self.track.pose, pose)
        moved = x_m / period_s, turn / period_s
        if abs(moved[0] - speeds[0]) > _OTHER_MPS + _OTHER * abs(speeds[0]):
            self.speeds = moved
        on_trial = self._doubted_s is not None
        if self._doubted_s is not None and stamp_s - self._doubted_s < self._look_s:
            self._window.clear()  # what counts is how the robot creeps afterwards
            return
        stated = 0.5 * period_s * np.add(speeds, self._stated)
        now = np.array([stamp_s, *stated, x_m, turn, abs(x_m), *moved])
        now[1:6] += self._window[-1][1:6] if self._window else 0.0
        self._window.append(now)
        while self._window[0][0] < stamp_s - _WINDOW_S:
            self._window.popleft()
        change = now - self._window[0]
        _, stated_m, stated_rad, moved_m, turned_rad, way_m = change[:6]
        # What a twist that lags behind lacks of a motion.
        late_m, late_rad = _TWIST_LAG_S * np.abs(change[6:])
        allowed_m = settings.frozen_motion if on_trial else _TWIST_ERROR_M
        wrong = abs(moved_m - stated_m) > allowed_m + late_m + settings.drift_ratio * way_m
        wrong |= abs(turned_rad - stated_rad) > (
            settings.yaw_tolerance + late_rad + settings.drift_ratio * abs(turned_rad)
        )
        if wrong:
            doubled_s = min(2.0 * self._look_s, _LONGEST_LOOK_S)
            self._look_s = doubled_s if on_trial else _SECOND_LOOK_S
            self._doubted_s = stamp_s
            self._window.clear()
        elif on_trial and way_m > _TWIST_ERROR_M:
            self._doubted_s, self._look_s = None, _SECOND_LOOK_S

    def check(self) -> Check:
        """What odometry allows."""
        if self._n_same >= _FROZEN_MESSAGES - 1:
            return _stand_at(Fault.FROZEN)
        if self._jumped_s is not None:
            return 0.0, Fault.JUMP
        if self._doubted_s is None or self._stamp_s is None:
            return _SOUND
        creeps = self._stamp_s - self._doubted_s >= self._look_s
        return (CREEP_MPS / self._settings.max_vel_x if creeps else 0.0), Fault.TWIST


class PeopleMonitor:
    """People whose positions stay the same although they walk, or whom the scan does not show."""

    def __init__(self, settings: GuardSettings) -> None:
        self._settings = settings
        self._position_m: FloatArray = np.zeros((0, 2))
        self._n_same = 1
        self._is_finite = True
        self._compared: deque[tuple[float, int, int]] = deque()
        self._doubted_s: float | None = None

    def take(self, position_m: FloatArray, velocity_mps: FloatArray) -> None:
        """Take positions and velocities (N, 2)."""
        walks = bool((np.abs(velocity_mps) > _WALKS_MPS).any())
        same = walks and np.array_equal(position_m, self._position_m)
        self._n_same = self._n_same + 1 if same else 1
        self._position_m = position_m
        self._is_finite = bool(np.isfinite(position_m).all() and np.isfinite(velocity_mps).all())

    def compare(self, scan: Scan, place_m: FloatArray) -> None:
        """Take the places (N, 2) of the people in the frame of a scan, at its stamp."""
        seen, unseen = shown_by(scan, place_m, self._settings.person_radius)
        self._compared.append((scan.stamp_s, seen, unseen))
        while self._compared[0][0] < scan.stamp_s - _WINDOW_S:
            self._compared.popleft()
        _, n_seen, n_unseen = map(sum, zip(*self._compared, strict=True))
        share = n_unseen / max(n_seen + n_unseen, 1)
        are_wrong = n_unseen >= _FROZEN_MESSAGES and share >= _UNSEEN_PEOPLE
        if unseen and (are_wrong or self._doubted_s is not None):
            self.doubt(scan.stamp_s)
        elif self._doubted_s is not None and scan.stamp_s - self._doubted_s > _PEOPLE_LOOK_S:
            self._doubted_s = None

    def doubt(self, stamp_s: float) -> None:
        """Ignore the people until the scan has shown all of them for 10 s."""
        self._doubted_s = stamp_s

    def check(self) -> Check:
        """What the people allow."""
        if not self._is_finite:
            return _stand_at(Fault.INVALID)
        if self._n_same >= _FROZEN_MESSAGES:
            return _stand_at(Fault.FROZEN)
        return _stand_at(None if self._doubted_s is None else Fault.UNSEEN)


class ScanMonitor:
    """What scans show, the share of lost rays, and scans that stay the same while the robot moves.

    space: that outlasts this monitor. settings: may be replaced.
    """

    def __init__(self, settings: GuardSettings, track: PoseTrack, space: KnownSpace) -> None:
        self.settings = settings
        self._frozen = FrozenMonitor(settings, track)
        self._space = space
        self.mount_of = space.mount_of
        self.lost_share, self.seen = 0.0, SeenSpace()

    def take(
        self, raw: Scan, odometry: Pose, people_m: FloatArray = NO_POINTS, pose: Pose | None = None
    ) -> Scan:
        """Take a scan; it is returned as interpreted. Arguments as of `KnownSpace.take`."""
        scan, self.seen = self._space.take(raw, odometry, people_m, pose)
        # Where nothing is within reach, sound scans are equal, too.
        has_return = bool(scan.valid.any() or self.seen.blind_share)
        self._frozen.take(
            raw.stamp_s, raw.ranges_m.tobytes() if has_return else np.float64(raw.stamp_s).tobytes()
        )
        self.lost_share = lost_share(scan)
        return scan

    def check(self) -> Check:
        """What the newest scan allows."""
        settings = self.settings
        if self.seen.blind_share >= settings.blind_rays:
            return 0.0, Fault.BLIND
        if self._frozen.is_frozen():
            return 0.0, Fault.FROZEN
        span = settings.blind_rays - settings.lost_rays
        share = min(max(settings.blind_rays - self.lost_share, 0.0) / span, 1.0)
        if self.seen.lost:
            return share, Fault.LOST_SECTOR
        return share, Fault.LOST_RAYS if share < 1.0 else None


def _leaps(before: Pose, after: Pose, duration_s: float, settings: GuardSettings) -> bool:
    """Whether a motion is longer than the largest speed explains."""
    x_m, y_m, _ = motion_between(before, after)
    reach_m = _JUMP_RATIO * settings.max_vel_x * duration_s + settings.pose_tolerance
    return math.hypot(x_m, y_m) > reach_m


def _stand_at(fault: Fault | None) -> Check:
    return _SOUND if fault is None else (0.0, fault)


def lost_share(scan: Scan) -> float:
    """Share of the rays that are not a number, or lack a range while a ray next to them has one.

    Three or more rays without a return side by side look along a free corridor.
    """
    if scan.valid.all():
        return 0.0
    without = ~scan.valid
    before, after = _neighbours(without)
    inside = without & before & after
    before, after = _neighbours(inside)
    corridor = inside | before | after
    return float((without & ~corridor | np.isnan(scan.ranges_m)).mean())


def _neighbours(rays: BoolArray) -> tuple[BoolArray, BoolArray]:
    """The values of the rays before and after each ray of a full turn."""
    turn = np.concatenate([rays[-1:], rays, rays[:1]])
    return turn[:-2], turn[2:]
