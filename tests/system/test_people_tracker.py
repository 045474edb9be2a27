"""A robot with a lidar alone drives, and the people of its tracker are those around it."""

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2

from serd_ros.convert.sensors import from_people_message
from serd_ros.endpoints import qos
from support.goals import Goals
from support.standin_robot import walkers
from support.waiting import wait_until

BODY_M, REACH_M, MATCH_M = 0.25, 5.0, 0.4


def in_sight(robot_m, people_m):
    """(N,) who is within reach, with no other body on the line from the robot to the centre."""
    place_m = people_m - robot_m
    away_m = np.hypot(*place_m.T)
    seen = away_m < REACH_M
    for person in np.flatnonzero(seen):
        ahead = place_m[person] / away_m[person]
        along_m, aside_m = place_m @ ahead, np.abs(place_m @ np.array([-ahead[1], ahead[0]]))
        hides = (along_m > 0) & (along_m < away_m[person]) & (aside_m < BODY_M)
        hides[person] = False
        seen[person] = not hides.any()
    return seen


class Sightings:
    """Errors of the tracks of people in sight, and how many people have none.

    robot_m: (2,) place of the robot, None before it is known.
    """

    def __init__(self, probe):
        self.robot_m, self.errors_m, self.n_missed = None, [], 0
        probe.node.create_subscription(Odometry, "odom", self._take_odometry, qos.SENSOR)
        probe.node.create_subscription(PointCloud2, "pedestrians", self._take_people, qos.STATE)

    def __str__(self):
        return f"{len(self.errors_m)} sightings, {self.n_missed} missed; {self.errors_m[-9:]}"

    def _take_odometry(self, message):
        """Odometry begins where the robot stands, and it looks north."""
        place = message.pose.pose.position
        self.robot_m = np.array([3.5 - place.y, 1.5 + place.x])

    def _take_people(self, message):
        if self.robot_m is None:
            return
        time_ns, tracked = from_people_message(message)
        people_m = walkers(time_ns * 1e-9).position_m
        away_m = np.linalg.norm(people_m[:, None] - tracked.position_m[None], axis=2)
        nearest_m = away_m.min(axis=1, initial=np.inf)[in_sight(self.robot_m, people_m)]
        self.errors_m += nearest_m[nearest_m < MATCH_M].tolist()
        self.n_missed += int((nearest_m >= MATCH_M).sum())


@pytest.mark.ros
@pytest.mark.slow
def test_a_robot_with_a_lidar_only_drives_and_publishes_the_people_around_it(
    nodes, probe, start_robot, save_model_of
):
    """Its lidar is turned, map to odom is stamped ahead, and no two topics have one stamp."""
    goals, sightings = Goals(probe), Sightings(probe)
    start_robot("--people", "--period", 0.103)
    nodes.start_stack("robot_people", model=str(save_model_of()))
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))

    def seen():
        names = "people_tracker", "local_planner", "guard", "strategy"
        return "\n".join([str(sightings), *map(nodes.log_of, names)])

    for place in ((3.5, 3.5), (3.5, 1.5)):
        goals.drive_to(place, seen)
    assert goals.ends == ["arrived", "arrived"]
    probe.spin_until(lambda: len(sightings.errors_m) > 100, seen=seen)
    assert np.median(sightings.errors_m) < 0.1, str(sightings)
    n_people = sightings.n_missed + len(sightings.errors_m)
    assert sightings.n_missed < 0.1 * n_people, str(sightings)
    assert "internal error" not in seen()
