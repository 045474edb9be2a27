"""A planner drives by people of each message type as it does by `pedestrians`."""

import math
import time

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped

from serd_bag.formats.rosbag2.message_types import message_type
from serd_cli.processes.node_commands import node_command
from serd_ros.convert.command import from_twist_stamped
from serd_ros.convert.pose import to_waypoint_message
from serd_ros.convert.sensors import to_people_message
from serd_ros.endpoints import qos
from serd_ros.endpoints.observation import ObservationPublisher
from serd_ros.endpoints.topic_types import message_class
from serd_sim.world.waypoint import Waypoint
from support.observations import PERIOD_S, observation_at
from support.people_messages import CLOUD, DETECTIONS, PEOPLE, TRACKED, PeopleMessages
from support.waiting import PATIENCE_S

pytestmark = [pytest.mark.ros, pytest.mark.slow]
MADE = PeopleMessages()
FIRST_TICK, N_TICKS, RESEND_AFTER_S = 2000, 60, 0.5
START, WAYPOINT = (3.5, 6.5, math.pi / 2), Waypoint(3.5, 12.5)
PEOPLE_M = np.array([[3.2, 10.5], [4.6, 9.5]])
WALKS_MPS = np.array([[0.1, -0.9], [-0.4, -0.2]])


class Drive:
    """A robot that follows the commands of the planner, among people who walk straight on."""

    def __init__(self, probe, kind):
        self.probe, self.kind = probe, kind
        self.observations = ObservationPublisher(probe.node)
        self.waypoints = probe.node.create_publisher(PoseStamped, "waypoint", qos.COMMAND)
        people_class = message_class(message_type(kind))
        self.people = probe.node.create_publisher(people_class, "people", qos.STATE)
        self.commands = {}
        self.subscription = probe.node.create_subscription(
            TwistStamped, "cmd_vel_raw", self.take, qos.STATE
        )

    def take(self, message):
        time_ns, command = from_twist_stamped(message)
        self.commands[time_ns] = command

    def publish_people(self, time_s):
        place_m = PEOPLE_M + (time_s - PERIOD_S * FIRST_TICK) * WALKS_MPS
        if self.kind == CLOUD:
            seen = observation_at(0.0, 0.0, people=place_m, velocity=WALKS_MPS)
            self.people.publish(to_people_message(seen.people, time_s))
        else:
            self.people.publish(MADE.encode(self.kind, time_s, place_m, WALKS_MPS))

    def command_at(self, pose, speeds, tick):
        time_s = PERIOD_S * tick
        observation = observation_at(
            *pose, time_s=time_s, speed_mps=speeds[0], yaw_rate_radps=speeds[1]
        )

        def publish():
            if tick == FIRST_TICK:  # so that ids have a velocity
                self.publish_people(time_s - PERIOD_S)
            self.publish_people(time_s)
            self.observations.publish(observation, pose)
            self.waypoints.publish(to_waypoint_message(WAYPOINT, time_s))

        def answered():
            """Send the tick again where the planner was not matched yet, as the simulator does."""
            if time.monotonic() - sent_s[0] > RESEND_AFTER_S:
                publish()
                sent_s[0] = time.monotonic()
            return round(time_s * 1e9) in self.commands

        sent_s = [-math.inf]
        self.probe.spin_until(answered)
        return self.commands[round(time_s * 1e9)]

    def run(self):
        """(N_TICKS, 3) poses."""
        self.probe.spin_until(self.people.get_subscription_count)
        pose, speeds, poses = START, (0.0, 0.0), []
        for tick in range(FIRST_TICK, FIRST_TICK + N_TICKS):
            command = self.command_at(pose, speeds, tick)
            speeds = command.linear_mps, command.angular_radps
            x, y, yaw = pose
            step_m = PERIOD_S * speeds[0]
            pose = (
                x + step_m * math.cos(yaw),
                y + step_m * math.sin(yaw),
                yaw + PERIOD_S * speeds[1],
            )
            poses.append(pose)
        return np.array(poses)

    def close(self):
        for publisher in (self.people, self.waypoints):
            self.probe.node.destroy_publisher(publisher)
        self.probe.node.destroy_subscription(self.subscription)


def test_people_of_each_type_give_the_decisions_of_pedestrians_to_a_millimetre(
    nodes, probe, ros_env
):
    given = {"people_topic": "people", "lockstep": True}
    poses = {}
    for kind in (CLOUD, PEOPLE, TRACKED, DETECTIONS, ""):
        planner = nodes.start(node_command("local_planner", given, {}, ros_env), "local_planner")
        drive = Drive(probe, kind or CLOUD)
        if not kind:  # the people matter
            drive.publish_people = lambda time_s, drive=drive: drive.people.publish(
                to_people_message(observation_at(0.0, 0.0).people, time_s)
            )
        poses[kind] = drive.run()
        drive.close()
        planner.terminate()
        assert planner.wait(PATIENCE_S) == 0
    assert np.abs(poses[""] - poses[CLOUD]).max() > 0.1
    for kind in (PEOPLE, TRACKED, DETECTIONS):
        assert np.abs(poses[kind] - poses[CLOUD])[:, :2].max() < 1e-3
