"""People of the lidar tracker beside the true ones, and a robot with a lidar alone that drives."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2

from serd_cli.processes.node_commands import node_command
from serd_ros.convert.pose import from_pose_stamped
from serd_ros.convert.sensors import from_people_message
from serd_ros.endpoints import qos
from support.goals import Goals
from support.people_in_sight import HeardSightings
from support.standin_robot import walkers
from support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
N_SIGHTINGS = 2000
DRIVERS = ["hallway_sim", "local_planner", "guard"]


def test_in_the_hallway_the_tracker_finds_the_people_of_the_simulator(
    nodes, probe, ros_env, quick_hallway
):
    """The planner drives by them, so their stamps are those of the observations."""
    poses, people = {}, {}

    def take_pose(message):
        time_ns, pose = from_pose_stamped(message)
        poses[time_ns] = np.array(pose[:2])

    def take_people(message):
        time_ns, seen = from_people_message(message)
        people[time_ns] = seen

    probe.node.create_subscription(PoseStamped, "robot_pose", take_pose, qos.STATE)
    probe.node.create_subscription(PointCloud2, "true_people", take_people, qos.STATE)
    sightings = HeardSightings(probe, poses.get, people.get)
    drive = {"episodes": 100, "required_nodes": DRIVERS}
    for name, given, renamed in (
        ("hallway_sim", {"scenario": quick_hallway, "seed": 3}, {"pedestrians": "true_people"}),
        ("people_tracker", {}, {}),
        ("local_planner", {}, {}),
        ("guard", {"scenario": quick_hallway, "people_from": "scan", "use_sim_time": True}, {}),
        ("scripted_expert", {"scenario": quick_hallway, **drive}, {}),
    ):
        nodes.start(node_command(name, given, renamed, ros_env), name)

    def seen():
        return f"{sightings}\n{nodes.log_of('people_tracker')}{nodes.log_of('scripted_expert')}"

    probe.spin_until(lambda: len(sightings.errors_m) > N_SIGHTINGS, seen=seen)
    print(sightings)
    driven_m = np.ptp(np.array(list(poses.values())), axis=0).max()
    assert driven_m > 3.0
    assert np.median(sightings.errors_m) < 0.05, str(sightings)
    assert np.quantile(sightings.errors_m, 0.95) < 0.2, str(sightings)
    assert sightings.missed_share < 0.1, str(sightings)
    assert sightings.nobody_share < 0.1, str(sightings)
    assert "internal error" not in seen()


def test_a_robot_with_a_lidar_only_drives_and_publishes_the_people_around_it(
    nodes, probe, start_robot, save_model_of
):
    """Its lidar is turned, map to odom is stamped ahead, and no two topics have one stamp."""
    places, goals = [], Goals(probe)

    def take(message):
        """Odometry begins where the robot stands, and it looks north."""
        place = message.pose.pose.position
        places.append(np.array([3.5 - place.y, 1.5 + place.x]))

    probe.node.create_subscription(Odometry, "odom", take, qos.SENSOR)
    sightings = HeardSightings(
        probe, lambda _: places[-1] if places else None, lambda at_ns: walkers(at_ns * 1e-9)
    )
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
    print(sightings)
    assert np.median(sightings.errors_m) < 0.1, str(sightings)
    assert sightings.missed_share < 0.1, str(sightings)
    assert "internal error" not in seen()
