"""Live, the planner answers each observation at once, and stops when they stop coming."""

import pytest

from serd_core.grid.grid import Action
from serd_ros.convert.motion import from_pose_stamped, to_intent, to_waypoint_message
from serd_ros.graph.graph import LOOPBACK_PROFILE
from serd_sim.world.waypoint import Waypoint
from support.nodes_in_process import node_in_process
from support.observations import observation_at
from support.valid_messages import valid_message


@pytest.fixture
def planner():
    with node_in_process("local_planner", lockstep=False) as running:
        yield running


def observe(running, time_s, *topics):
    for topic in topics or ("pedestrians", "odom", "robot_pose"):
        running.receive(topic, valid_message(topic, time_s))


def test_each_observation_is_answered_by_one_command_without_a_timer(planner):
    planner.receive("waypoint", valid_message("waypoint", 10.0))
    for number in range(20):
        observe(planner, 10.0 + 0.05 * number)
        assert planner.published["cmd_vel_raw"] == number + 1
    planner.call_timers()
    assert planner.published["cmd_vel_raw"] == 20


def test_silence_of_the_observations_stops_the_robot_again_and_again(planner):
    planner.receive("waypoint", valid_message("waypoint", 10.0))
    observe(planner, 10.0)
    planner.wait(0.6)
    for number in (2, 3):
        planner.call_timers()
        assert planner.published["cmd_vel_raw"] == number
        assert planner.sent["cmd_vel_raw"].linear.x == 0.0
    observe(planner, 10.6)
    assert planner.published["cmd_vel_raw"] == 4


def test_without_people_pose_and_odometry_of_unequal_stamps_suffice():
    given = {"people_from": "none", "stamp_tolerance_s": 0.3, "lockstep": False}
    with node_in_process("local_planner", **given) as running:
        running.receive("waypoint", valid_message("waypoint", 10.0))
        observe(running, 10.02, "odom")
        observe(running, 10.0, "robot_pose")
        assert running.published["cmd_vel_raw"] == 1
        observe(running, 10.01, "robot_pose")  # sooner than a control period
        observe(running, 10.4, "robot_pose")  # too far from odom
        assert running.published["cmd_vel_raw"] == 1
        observe(running, 10.38, "odom")
        observe(running, 10.45, "robot_pose")
        assert running.published["cmd_vel_raw"] == 2
        running.assert_alive()


def test_unequal_stamps_are_named_where_equal_ones_are_required(planner):
    observe(planner, 10.0)
    observe(planner, 12.0, "robot_pose")
    planner.wait(3.0)
    observe(planner, 11.5, "odom")
    planner.call_timers()
    assert planner.health["name"] == "local_planner: observation"
    sentence = "odom is 0.500 s older than robot_pose; at most stamp_tolerance_s = 0"
    assert sentence in planner.health["message"]


@pytest.mark.parametrize("profile", [str(LOOPBACK_PROFILE), "my_profile.xml"])
def test_where_no_other_machine_is_searched_a_missing_publisher_says_how_to_do_so(
    monkeypatch, profile
):
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", profile)
    with node_in_process("local_planner", lockstep=False, stamp_tolerance_s=0.3) as running:
        running.wait(3.0)
        running.call_timers()
        message = running.health["message"]
    assert "odom has no publisher" in message
    assert ("DISCOVERY_RANGE=SUBNET" in message) == (profile == str(LOOPBACK_PROFILE))


class Lockstep:
    """A planner in lock-step with the robot at places of the test; answered: whether it did."""

    def __init__(self, running):
        self.running = running

    def answered(self, time_s, y_m, directive=None):
        n_before = self.running.published["cmd_vel_raw"]
        self.running.observe(observation_at(2.5, y_m, 1.5, time_s=time_s))
        if isinstance(directive, Waypoint):
            self.running.receive("waypoint", to_waypoint_message(directive, time_s))
        elif directive is not None:
            self.running.receive("intent", to_intent(directive, time_s))
        return self.running.published["cmd_vel_raw"] > n_before


@pytest.fixture
def lockstep():
    with node_in_process("local_planner", lockstep=True) as running:
        yield Lockstep(running)


@pytest.mark.parametrize("directive", [Action.NORTH, Waypoint(2.5, 5.5)])
def test_in_lock_step_a_planner_waits_for_a_directive_where_a_decision_epoch_begins(
    lockstep, directive
):
    assert not lockstep.answered(10.0, 3.5)
    assert lockstep.answered(10.0, 3.5, directive)
    for tick in range(1, 9):
        assert lockstep.answered(10.0 + 0.05 * tick, 3.5 + 0.06 * tick)
    assert lockstep.answered(10.45, 4.05), "within the hysteresis"
    assert not lockstep.answered(10.5, 4.11)
    assert lockstep.answered(10.5, 4.11, directive)
    assert lockstep.answered(10.5, 4.11), "a tick that comes again"
    assert lockstep.answered(10.55, 4.11)
    assert not lockstep.answered(14.0, 3.6), "the first tick of an episode"
    assert lockstep.answered(14.0, 3.6, directive)


@pytest.mark.parametrize(
    ("directive", "length_s"), [(Action.NORTH, 4.0), (Waypoint(2.5, 3.5), 1.0)]
)
def test_in_lock_step_a_decision_that_leads_nowhere_ends_after_patience_and_one_to_wait_sooner(
    lockstep, directive, length_s
):
    assert lockstep.answered(10.0, 3.5, directive)
    n_ticks = round(length_s / 0.05)
    assert all(lockstep.answered(10.0 + 0.05 * tick, 3.5) for tick in range(1, n_ticks))
    assert not lockstep.answered(10.0 + length_s, 3.5)


def test_a_robot_that_stands_at_its_waypoint_turns_to_the_heading_of_it(planner):
    def turn_at(time_s, heading_rad):
        here = planner.sent_pose
        message = to_waypoint_message(Waypoint(*here[:2]), time_s, here[2] + heading_rad)
        planner.receive("waypoint", message)
        observe(planner, time_s)
        return planner.sent["cmd_vel_raw"].angular.z

    pose = valid_message("robot_pose", 10.0)
    planner.sent_pose = from_pose_stamped(pose)[1]
    assert turn_at(10.0, 1.0) > 0.3
    assert turn_at(10.1, -1.0) < -0.3
    assert turn_at(10.2, 0.05) == 0.0
    planner.receive("intent", to_intent(Action.WAIT, 10.3))
    observe(planner, 10.3)
    assert planner.sent["cmd_vel_raw"].angular.z == 0.0
    planner.assert_alive()


def test_speeds_of_a_running_planner_can_be_set_and_others_need_another_start(planner):
    planner.receive("waypoint", valid_message("waypoint", 10.0))
    observe(planner, 10.0)
    assert planner.set(max_vel_x=0.05).successful
    for number in range(1, 10):
        planner.receive("waypoint", valid_message("waypoint", 10.0 + 0.1 * number))
        observe(planner, 10.0 + 0.1 * number)
    assert 0.0 <= planner.sent["cmd_vel_raw"].linear.x <= 0.05
    for wanted, sentence in (
        ({"max_vel_x": 50.0}, "max_vel_x"),
        ({"max_vel_x": -1.0}, "max_vel_x must be greater than 0"),
        ({"vx_samples": 5}, "vx_samples is fixed while local_planner runs"),
    ):
        refused = planner.set(**wanted)
        assert (refused.successful, sentence in refused.reason) == (False, True), refused.reason
    planner.assert_alive()
