"""The rules of the guard for each input, with a robot that drives straight on in free space."""

import math

import numpy as np
import pytest

from serd_files.errors import USER_ERRORS
from serd_files.yaml_config import yaml_model
from serd_sim.safety.guard import Guard
from serd_sim.safety.reasons import Fault, GuardAction, Source
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.settings import GuardSettings
from serd_sim.world.command import STOP, Command

PERIOD_S = 0.05
GEOMETRY = ScanGeometry(-math.pi, math.tau / 360, 0.1, 10.0)
ODOMETRY, POSE, PEOPLE, SCAN = Source.ODOMETRY, Source.POSE, Source.PEOPLE, Source.SCAN
SOURCE_NAMES = ("robot_pose", "pedestrians", "scan")
SOURCES = {"odometry": ODOMETRY, "pose": POSE, "people": PEOPLE, "scan": SCAN}


class Drive:
    """Feeds a guard with sound inputs, changed by `faults`, while the robot obeys it.

    faults: by source, a function from (stamp_s, value) to the same, or to None for no message.
    """

    def __init__(self, settings=None, **faults):
        self.guard = Guard(settings)
        self.time_s, self.x_m, self.speed_mps = 0.0, 0.0, 0.0
        self.command = Command(1.2, 0.0)
        self.faults = faults
        self.rng = np.random.default_rng(0)
        self.output = None

    def tick(self):
        guard, now_s = self.guard, self.time_s
        guard.advance(now_s)
        pose = (self.x_m, 0.0, 0.0)
        self._send("odometry", guard.receive_odometry, (pose, (self.speed_mps, 0.0)))
        self._send("pose", guard.receive_pose, (pose,))
        walker = np.array([[now_s, 5.0]])
        self._send("people", guard.receive_people, (walker, np.array([[1.0, 0.0]])))
        if round(now_s / PERIOD_S) % 2 == 0:
            ranges_m = self.rng.uniform(3.0, 9.0, 360).astype(np.float32)
            self._send("scan", lambda t, r: guard.receive_scan(Scan(t, r, GEOMETRY)), (ranges_m,))
        self._send("command", guard.receive_command, (self.command,))
        self.output = guard.step(now_s)
        change = self.output.command.linear_mps - self.speed_mps
        self.speed_mps += min(max(change, -2.5 * PERIOD_S), 2.5 * PERIOD_S)
        self.x_m += self.speed_mps * PERIOD_S
        self.time_s = round((self.time_s + PERIOD_S) / PERIOD_S) * PERIOD_S
        return self.output

    def _send(self, name, receive, value):
        message = self.time_s, *value
        if name in self.faults:
            message = self.faults[name](*message)
        if message is not None:
            receive(*message)

    def run(self, duration_s):
        for _ in range(round(duration_s / PERIOD_S)):
            self.tick()
        return self.output

    def until_zero_s(self):
        """Time until the command is zero."""
        start_s = self.time_s
        while self.tick().command != STOP:
            assert self.time_s - start_s < 5.0
        return round(self.time_s - PERIOD_S - start_s, 6)

    def reasons(self):
        return {(each.source, each.fault) for each in self.output.reasons}


def driving(settings=None, **faults):
    drive = Drive(settings)
    assert drive.run(3.0).reasons == ()
    assert drive.speed_mps == 1.2
    drive.faults = faults
    return drive


def never(*_):
    return None


def held():
    """A value that stays what it was, under fresh stamps."""
    first = []

    def freeze(stamp_s, *value):
        first.append(value)
        return stamp_s, *first[0]

    return freeze


def late(stamp_s, *value):
    return stamp_s - 1.0, *value


def early(stamp_s, *value):
    return stamp_s + 3600.0, *value


def half_as_fast():
    start = []

    def lag(stamp_s, pose):
        start.append(pose[0])
        return stamp_s, (start[0] + 0.5 * (pose[0] - start[0]), 0.0, 0.0)

    return lag


def reads(value):
    return lambda: lambda stamp_s, ranges_m: (stamp_s, np.full_like(ranges_m, value))


BY_MAP = GuardSettings(observation_sources=("robot_pose", "pedestrians"))


@pytest.mark.parametrize(
    ("settings", "name", "change", "within_s", "fault", "hold_s", "back_s"),
    [
        *((None, name, lambda: never, 0.2, Fault.STALE, 0.0, 3.0) for name in SOURCES),
        *((None, name, lambda: early, 0.1, Fault.FUTURE, 0.0, 3.0) for name in SOURCES),
        (None, "scan", reads(math.nan), 0.1, Fault.BLIND, 1.0, 0.3),
        (None, "scan", reads(math.inf), 0.1, Fault.BLIND, 0.0, 0.3),
        (None, "scan", reads(0.0), 0.1, Fault.BLIND, 1.0, 0.3),
        (None, "scan", held, 0.25, Fault.FROZEN, 10.0, 0.2),
        (None, "pose", held, 0.15, Fault.FROZEN, 30.0, 1.1),
        (None, "pose", half_as_fast, 0.8, Fault.INCONSISTENT, 0.0, 1.1),
        (None, "odometry", held, 0.15, Fault.FROZEN, 0.0, 1.1),
        (BY_MAP, "people", held, 0.2, Fault.FROZEN, 0.0, 0.3),
    ],
)
def test_an_input_without_a_sound_value_stands_the_robot_until_it_has_one(
    settings, name, change, within_s, fault, hold_s, back_s
):
    drive = driving(settings, **{name: change()})
    assert drive.until_zero_s() <= within_s
    assert fault in {each for _, each in drive.reasons()}
    if fault is Fault.FUTURE:
        assert min(drive.guard.ages_s(drive.time_s).values()) == pytest.approx(-3600.0, abs=0.1)
    for _ in range(round(hold_s / PERIOD_S)):
        assert drive.tick().command == STOP
    drive.faults, begun_s = {}, drive.time_s
    while drive.tick().command == STOP:
        pass
    stood_s = drive.time_s - PERIOD_S - begun_s
    assert stood_s < back_s
    assert stood_s >= 1.0 or (name, fault) != ("pose", Fault.FROZEN)
    drive.run(13.0 if name == "pose" else 3.0)  # after a jump of which people count again
    assert (drive.output.reasons, drive.speed_mps) == ((), 1.2)


@pytest.mark.parametrize("speed_mps", [0.1, 0.25, 1.2])
def test_a_pose_that_does_not_move_stands_a_robot_of_any_speed_within_its_tolerance(speed_mps):
    drive = Drive(GuardSettings(pose_tolerance=0.5))
    drive.command = Command(speed_mps, 0.0)
    drive.run(12.0)
    begun_m = drive.x_m
    # Not bit for bit: a localisation and odometry make a little of it.
    drive.faults["pose"] = lambda t, pose: (t, (begun_m + 0.01 * math.sin(t), *pose[1:]))
    while drive.tick().command != STOP:
        assert drive.x_m - begun_m < (0.5 + 0.02) / 0.9 + 0.2 * speed_mps
    assert Fault.INCONSISTENT in {fault for _, fault in drive.reasons()}
    stood_s = []
    for _ in range(3):  # it tries again, and waits for twice as long each time
        begun_s = drive.time_s
        while drive.tick().command == STOP:
            pass
        stood_s.append(drive.time_s - begun_s)
        while drive.tick().command != STOP:
            pass
    assert stood_s == pytest.approx([1.0, 2.0, 4.0], abs=0.15)
    drive.faults = {}
    drive.run(25.0)
    assert (drive.output.reasons, drive.speed_mps) == ((), speed_mps)


@pytest.mark.parametrize("reach_m", [0.1, 0.14])
def test_a_drift_that_is_allowed_stands_no_robot_that_drives_to_and_fro(reach_m):
    """Wheels that read 8 % too much ahead, and right back: the error grows with the way."""
    drive, read_m, last_m = Drive(), 0.0, 0.0

    def drifting(stamp_s, pose, speeds):
        nonlocal read_m, last_m
        step_m, last_m = pose[0] - last_m, pose[0]
        read_m += step_m * (1.08 if step_m > 0 else 1.0)
        return stamp_s, (read_m, 0.0, 0.0), speeds

    drive.faults["odometry"] = drifting
    for tick in range(1200):
        drive.command = Command(0.3 if tick // round(reach_m / 0.3 / PERIOD_S) % 2 else -0.3, 0.0)
        drive.tick()
        assert Fault.INCONSISTENT not in {fault for _, fault in drive.reasons()}


@pytest.mark.parametrize(
    ("increment_rad", "n_rays"), [(1e30, 1), (1e9, 3), (7.0, 2), (0.1, 1000), (6.0, 5)]
)
def test_a_scan_whose_rays_are_no_scan_is_rejected(increment_rad, n_rays):
    drive = Drive()
    ranges_m = np.full(n_rays, 3.0, dtype=np.float32)
    geometry = ScanGeometry(0.0, increment_rad, 0.1, 10.0)
    drive.faults["scan"] = lambda stamp_s, _: drive.guard.receive_scan(
        Scan(stamp_s, ranges_m, geometry)
    )
    assert drive.run(0.5).command == STOP
    assert (SCAN, Fault.MISSING) in drive.reasons()


def test_a_robot_stands_where_inputs_have_not_come_or_have_old_stamps():
    for name in SOURCES:
        drive = Drive(**{name: never})
        assert drive.run(1.0).command == STOP
        assert Fault.MISSING in {fault for _, fault in drive.reasons()}
    drive = driving(**dict.fromkeys(SOURCES, late))
    assert drive.until_zero_s() <= 0.25
    assert drive.run(5.0).command == STOP


def jumped(stamp_s, pose, *more):
    return stamp_s, (pose[0] + 2.0, *pose[1:]), *more


@pytest.mark.parametrize(("name", "sources"), [("pose", SOURCE_NAMES), ("odometry", ("scan",))])
def test_a_place_that_jumps_needs_a_second_look(name, sources):
    drive = driving(GuardSettings(observation_sources=sources), **{name: jumped})
    assert drive.until_zero_s() == 0.0
    assert (SOURCES[name], Fault.JUMP) in drive.reasons()
    stopped_s = drive.time_s
    while drive.tick().command == STOP:
        pass
    assert drive.time_s - stopped_s == pytest.approx(1.0, abs=0.06)


def speeds_of(scan):
    """Of two seconds with a fault of scans that lasts."""
    drive = driving(scan=scan)
    drive.run(2.0)
    return [drive.tick().command.linear_mps for _ in range(40)], drive.output.action


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_the_speed_falls_with_the_share_of_lost_rays(value):
    speeds, rng = [], np.random.default_rng(1)
    for share in (0.0, 0.1, 0.3):
        lost = lambda t, r, share=share: (t, np.where(rng.random(360) < share, value, r))  # noqa: E731
        speeds.append(np.mean(speeds_of(lost)[0]))
    assert speeds[0] == 1.2
    assert np.all(np.diff(speeds) < 0.0)
    assert speeds[-1] > 0.2


def open_ahead(stamp_s, ranges_m):
    ranges_m[160:200] = math.inf
    return stamp_s, ranges_m


def drifting(stamp_s, pose, velocity):
    return stamp_s, (1.08 * pose[0], 0.0, 0.0), velocity


def test_a_free_corridor_usual_drift_and_the_same_scans_of_a_standing_robot_are_no_faults():
    for faults in ({"scan": open_ahead}, {"odometry": drifting}):
        drive = Drive(**faults)
        assert drive.run(6.0).reasons == ()
        assert drive.speed_mps == 1.2
    drive = driving()
    drive.command = STOP
    drive.run(2.0)
    drive.faults = {"scan": held()}
    assert drive.run(3.0).reasons == ()


@pytest.mark.parametrize("newest", [-1, -2])
def test_a_robot_that_is_set_elsewhere_in_an_unchanging_world_drives_on(newest):
    """Its scans stay the same until it moves, so a frozen scan would end with no evidence.

    The first message of odometry is lost; all others are in time, or one control period late.
    """
    drive, waiting = driving(), []
    drive.faults["scan"] = lambda t, r: (t, np.full_like(r, 5.0 + 0.01 * drive.x_m))

    def lost_once(*message):
        waiting.append(message)
        return waiting[newest] if len(waiting) > 1 else None

    drive.command = STOP
    drive.run(1.0)
    drive.faults["odometry"] = lost_once
    drive.x_m += 0.1
    drive.run(1.0)
    drive.command = Command(1.2, 0.0)
    drive.run(0.5)
    assert drive.reasons() == set()
    assert drive.speed_mps > 0.9


def scene_of_people(drive, error_m=0.0):
    """Faults that show two standing people in the scan; positions are `error_m` off sideways."""
    world_m = np.array([[drive.x_m + 2.5, 2.0], [drive.x_m + 3.0, -2.5]])

    def shown(stamp_s, ranges_m):
        ranges_m[:] = 8.0 + 0.1 * drive.rng.random(360)
        angle = GEOMETRY.angle_min_rad + GEOMETRY.angle_increment_rad * np.arange(360)
        for x_m, y_m in world_m - [drive.x_m, 0.0]:
            away_m = math.hypot(x_m, y_m)
            aside = np.remainder(angle - math.atan2(y_m, x_m) + math.pi, math.tau) - math.pi
            ranges_m[np.abs(aside) < math.asin(0.25 / away_m)] = away_m - 0.25
        return stamp_s, np.maximum(ranges_m, 0.2).astype(np.float32)

    def stated(stamp_s, *_):
        return stamp_s, np.stack([world_m[:, 0], world_m[:, 1] + error_m], axis=1), np.zeros((2, 2))

    return {"people": stated, "scan": shown}


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
def test_people_whom_the_scan_shows_are_no_fault(yaw_rad):
    drive = driving(GuardSettings(sensor_yaw=yaw_rad))
    faults = scene_of_people(drive)
    shift = round(yaw_rad / GEOMETRY.angle_increment_rad)
    drive.faults = faults | {"scan": lambda t, r: (t, np.roll(faults["scan"](t, r)[1], -shift))}
    drive.run(1.0)
    assert drive.output.reasons == ()
    assert drive.speed_mps == 1.2


def no_numbers(stamp_s, place, velocity):
    return stamp_s, place * math.nan, velocity


@pytest.mark.parametrize(
    ("faults", "duration_s", "fault"),
    [
        (lambda _: {"people": held()}, 1.0, Fault.FROZEN),
        (lambda _: {"people": no_numbers}, 0.5, Fault.INVALID),
        (lambda drive: scene_of_people(drive, np.array([-1.4, 1.4])), 0.6, Fault.UNSEEN),
        (lambda _: {"pose": jumped}, 4.0, Fault.UNSEEN),
    ],
)
def test_people_who_cannot_be_right_are_ignored_and_the_robot_drives_slowly_on_the_scan(
    faults, duration_s, fault
):
    drive = driving()
    drive.faults = faults(drive)
    drive.run(duration_s)
    assert drive.reasons() == {(PEOPLE, fault)}
    assert drive.output.action is GuardAction.LIMIT
    assert drive.output.command.linear_mps == pytest.approx(0.5)
    drive.faults["scan"] = never
    drive.until_zero_s()
    assert drive.run(2.0).command == STOP


def test_people_count_again_once_the_scan_has_shown_them():
    drive = driving()
    drive.faults = scene_of_people(drive, np.array([-1.4, 1.4]))
    drive.run(0.6)
    drive.faults = {}
    drive.run(9.0)
    assert drive.reasons() == {(PEOPLE, Fault.UNSEEN)}
    drive.run(2.0)
    assert drive.output.reasons == ()
    jump = driving(pose=jumped)
    jump.run(12.0)
    assert jump.output.reasons == ()
    alone = driving(BY_MAP)
    alone.faults = jump.faults
    alone.run(3.0)
    assert alone.output.reasons == ()


@pytest.mark.parametrize("command", [Command(math.nan, 0.0), Command(0.5, math.inf)])
@pytest.mark.parametrize("overridden", [False, True])
def test_a_command_that_is_not_finite_is_a_stop_also_under_an_override(command, overridden):
    drive = driving()
    drive.guard.receive_override(drive.time_s, overridden)
    drive.command = command
    assert drive.tick().command == STOP
    assert drive.reasons() == {(Source.COMMAND, Fault.INVALID)}


def test_a_command_is_followed_for_its_timeout_only():
    drive = driving(command=never)
    assert drive.until_zero_s() == pytest.approx(0.2, abs=0.051)
    assert drive.reasons() == {(Source.COMMAND, Fault.STALE)}


def test_messages_that_are_no_values_are_rejected_and_counted():
    drive = driving(
        pose=lambda t, _: (t, (math.nan, 0.0, 0.0)),
        odometry=lambda t, pose, _: (t, pose, (math.inf, 0.0)),
        scan=lambda t, r: (t, r[:0]),
    )
    drive.until_zero_s()
    assert set(drive.guard.n_rejected) == {POSE, ODOMETRY, SCAN}


def test_a_clock_that_goes_back_begins_a_new_session():
    drive = driving()
    drive.time_s = 1.0
    drive.faults = {"scan": never}
    assert drive.tick().command == STOP
    assert drive.reasons() == {(SCAN, Fault.MISSING)}
    drive.faults = {}
    drive.run(0.2)
    assert drive.output.reasons == ()


def test_a_clock_that_leaps_ahead_makes_all_inputs_stale_until_fresh_ones_come():
    drive = driving()
    drive.time_s += 4.0
    assert drive.guard.step(drive.time_s).command == STOP
    drive.x_m += 10.0  # another episode begins elsewhere
    drive.time_s = round(drive.time_s / 0.1) * 0.1
    assert drive.tick().command == Command(1.2, 0.0)
    assert drive.output.reasons == ()


def test_a_held_override_passes_every_command_until_it_times_out_or_is_released():
    drive = driving(scan=never)
    drive.run(1.0)
    drive.guard.receive_override(drive.time_s, True)
    for _ in range(6):
        drive.tick()
        assert drive.output.overridden
        assert drive.output.command == drive.command
        assert drive.output.reasons
    drive.run(0.1)
    assert not drive.output.overridden
    assert drive.output.command == STOP
    for held_down in (True, False):
        drive.guard.receive_override(drive.time_s, held_down)
    assert drive.tick().command == STOP


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("observation_sources: [pedestrians]", "must have 'robot_pose'"),
        ("observation_sources: [robot_pose]", "must have 'scan' or 'pedestrians'"),
        ("slowdown_timeout: 0.3", r"slowdown_timeout must be less than source_timeout \(0.25\)"),
        ("lost_rays: 0.6", "lost_rays must be less than blind_rays"),
    ],
)
def test_settings_that_contradict_each_other_are_rejected(text, sentence):
    with pytest.raises(USER_ERRORS, match=sentence):
        yaml_model(text, GuardSettings, name="guard")
