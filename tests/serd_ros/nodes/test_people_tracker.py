"""The tracker publishes people at each pose, or names why it cannot."""

import math

import numpy as np
import pytest

from serd_ros.convert.sensors import from_people_message, to_scan
from serd_sim.robot.sensors import Lidar
from support.nodes_in_process import node_in_process
from support.valid_messages import HALLWAY, PLACE_M, valid_message

LIDAR = Lidar(HALLWAY.lidar, HALLWAY.wall_segments_m, 0.25)
YAW_RAD = 1.5  # of valid poses
SOMEBODY = np.array([[4.5, 7.5]])


def scan_at(time_s, *, people=SOMEBODY, frame="base_link", turned_rad=0.0):
    pose = *PLACE_M, YAW_RAD + turned_rad
    ranges_m = LIDAR.scan(pose, people[:, 0], people[:, 1])
    message = to_scan(ranges_m, HALLWAY.lidar, time_s)
    message.header.frame_id = frame
    return message


@pytest.fixture
def running():
    with node_in_process("people_tracker") as found:
        yield found
        found.assert_alive()


def observe(running, time_s):
    for topic in ("odom", "robot_pose"):
        running.receive(topic, valid_message(topic, time_s))


def test_people_have_the_stamp_of_the_pose_and_the_frame_of_the_map(running):
    running.receive("scan", scan_at(10.0))
    observe(running, 10.0)
    message = running.sent["pedestrians"]
    assert message.header.frame_id == "map"
    time_ns, people = from_people_message(message)
    assert time_ns == 10_000_000_000
    assert people.position_m == pytest.approx(SOMEBODY, abs=0.05)
    for number in range(1, 5):
        observe(running, 10.0 + 0.05 * number)
    assert running.published["pedestrians"] == 5
    subscribed = {each.topic_name for each in running.node.subscriptions}
    assert "/pedestrians" not in subscribed  # its own people are not those of others


def test_faults_are_reported_once_each_and_their_end_too(running):
    observe(running, 9.9)
    assert running.published["pedestrians"] == 0
    assert running.health["message"] == "scan: no message yet"
    running.receive("scan", scan_at(10.0, people=np.zeros((0, 2))))
    observe(running, 10.0)
    running.published["diagnostics"] = 0
    blind = scan_at(10.1)
    blind.ranges[:300] = type(blind.ranges)("f", [math.inf] * 300)
    running.receive("scan", blind)
    for time_s in (10.1, 10.15):
        observe(running, time_s)
    assert running.published["pedestrians"] == 1
    assert running.health["message"] == "scan: too few valid rays"
    assert running.published["diagnostics"] == 1
    running.receive("scan", scan_at(10.2))
    observe(running, 10.2)
    assert running.published["pedestrians"] == 2
    assert running.health["message"] == ""
    observe(running, 10.7)
    assert running.health["message"] == "scan: stamp too old"


@pytest.mark.parametrize(("prefix", "frame"), [("", "laser"), ("", "/laser"), ("a/", "a/laser")])
def test_a_lidar_in_a_frame_of_its_own_is_placed_by_parameters_and_others_need_tf(prefix, frame):
    given = {"scan_frame": frame, "sensor_yaw": math.pi / 2, "frame_prefix": prefix}
    with node_in_process("people_tracker", **given) as running:
        running.receive("scan", scan_at(10.0, frame=frame, turned_rad=math.pi / 2))
        observe(running, 10.0)
        _, people = from_people_message(running.sent["pedestrians"])
        assert people.position_m == pytest.approx(SOMEBODY, abs=0.05)
        running.receive("scan", scan_at(10.1, frame="other"))
        assert running.node.callbacks.n_rejected == 1
        observe(running, 10.1)
        running.assert_alive()


def test_limits_of_the_scans_change_while_it_runs(running):
    running.receive("scan", scan_at(10.0))
    for time_s, n_published in ((10.0, 1), (10.3, 2)):
        observe(running, time_s)
        assert running.published["pedestrians"] == n_published
    assert running.set(source_timeout=0.3).successful
    observe(running, 10.35)
    assert running.published["pedestrians"] == 2
    assert running.health["message"] == "scan: stamp too old"
