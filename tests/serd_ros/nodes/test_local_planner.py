"""Live, the planner answers each observation at once, and stops when they stop coming."""

import pytest

from serd_ros.nodes import local_planner
from support.nodes_in_process import node_in_process
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
    (status,) = planner.sent["diagnostics"].status
    assert status.name == "local_planner: observation"
    assert "odom is 0.500 s older than robot_pose; at most stamp_tolerance_s = 0" in status.message


def test_amcl_pose_is_carried_on_by_odometry(monkeypatch):
    seen = []
    monkeypatch.setattr(
        local_planner.LocalPlannerNode, "_on_observation", lambda _, each: seen.append(each)
    )
    given = {"people_from": "none", "pose_from": "amcl_pose", "stamp_tolerance_s": 0.3}
    with node_in_process("local_planner", lockstep=False, **given) as running:
        odometry = valid_message("odom", 10.0)
        running.receive("odom", odometry)
        assert seen == []
        found = valid_message("amcl_pose", 9.98)
        running.receive("amcl_pose", found)
        odometry = valid_message("odom", 10.1)
        odometry.pose.pose.position.x += 0.2
        running.receive("odom", odometry)
        (observation,) = seen
        assert observation.time_s == pytest.approx(10.1)
        moved = observation.x_m - found.pose.pose.position.x
        assert (moved**2 + (observation.y_m - found.pose.pose.position.y) ** 2) == pytest.approx(
            0.04
        )


def test_frames_with_the_prefix_of_the_robot_are_received_and_published():
    given = {"frame_prefix": "robot1/", "stamped_cmd_vel": True, "lockstep": False}
    with node_in_process("local_planner", **given) as running:
        running.receive("waypoint", valid_message("waypoint", 10.0))
        odometry = valid_message("odom", 10.0)
        odometry.header.frame_id, odometry.child_frame_id = "robot1/odom", "robot1/base_link"
        running.receive("odom", odometry)
        observe(running, 10.0, "pedestrians", "robot_pose")
        assert running.sent["cmd_vel_raw"].header.frame_id == "robot1/base_link"
        odometry = valid_message("odom", 10.05)
        odometry.header.frame_id = "robot2/odom"
        running.receive("odom", odometry)
        assert "got 'robot2/odom'" in str(running.rejected)


def test_people_are_those_of_the_topic_that_is_named_for_them(monkeypatch):
    seen = []
    monkeypatch.setattr(
        local_planner.LocalPlannerNode, "_on_observation", lambda _, each: seen.append(each)
    )
    with node_in_process("local_planner", people_topic="tracks", lockstep=False) as running:
        running.receive("tracks", valid_message("pedestrians", 10.0))
        observe(running, 10.0, "odom", "robot_pose")
        (observation,) = seen
        assert observation.people_position_m.tolist() == [[4.5, 12.0], [2.5, 9.0]]
        assert "/pedestrians" not in {each.topic_name for each in running.node.subscriptions}
