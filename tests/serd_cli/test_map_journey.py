"""From the map and a bag of laps of another robot to a model that drives there, without options."""

from pathlib import Path

import numpy as np

from serd_app.learning.learning_files import read_learning_files
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.scenario import load_scenario
from support.bag_messages import Messages
from support.foreign_bags import STEP_S, ForeignBag
from support.ros_maps import FREE, OCCUPIED, write_map

SPEED_MPS = 0.4
MAPPING = "pose_topic: odom\naction_from: motion\n"


def two_rooms():
    """8 m x 5 m with a wall across the middle and a door in it."""
    shades = np.full((100, 160), FREE, dtype=np.uint8)
    for border in (shades[:2], shades[-2:], shades[:, :2].T, shades[:, -2:].T):
        border[:] = OCCUPIED
    shades[:, 79:81] = OCCUPIED
    shades[44:68, 79:81] = FREE
    return shades


def laps(n_laps, rng):
    """(T, 5) time, x, y, yaw, speed: through the door to the goal and back, standing nowhere."""
    way = [(1.0, 1.0), (2.6, 1.2), (3.4, 2.2), (4.7, 2.2), (5.6, 3.4), (6.7, 3.9)]
    points = np.array([way[0]])
    for _ in range(n_laps):
        there = np.array(way[1:]) + rng.normal(0.0, 0.05, (len(way) - 1, 2))
        points = np.concatenate([points, there, np.array(way[-2::-1])])
    steps_m = np.linalg.norm(np.diff(points, axis=0), axis=1)
    at_s = np.concatenate([[0.0], np.cumsum(steps_m) / SPEED_MPS])
    time_s = np.arange(0.0, at_s[-1], STEP_S)
    x, y = (np.interp(time_s, at_s, each) for each in points.T)
    yaw = np.arctan2(np.gradient(y), np.gradient(x))
    return np.stack([time_s, x, y, yaw, np.full(len(time_s), SPEED_MPS)], axis=1)


def test_laps_on_the_map_of_a_robot_become_a_model_that_drives_there(serd, tmp_path):
    path = write_map(tmp_path, "rooms", two_rooms(), origin="[0.0, 0.0, 0.0]")
    points = ("--start", "1.0,1.0", "--goal", "6.7,3.9")
    robot = ("--robot-radius-m", 0.2, "--max-speed-mps", 0.5)
    made = serd("scenario", "from-map", path, *points, *robot)
    assert made.code == 0, made.err
    bag, scenario = ForeignBag(Messages()), Path("rooms-scenario.yaml")
    bag.add_odometry("/odom", laps(6, np.random.default_rng(0)))
    Path("mapping.yaml").write_text(MAPPING)
    words = ("--mapping", "mapping.yaml", "--scenario", scenario, "--json")
    read = serd("demos", bag.write(tmp_path / "bag"), *words).values
    (counts,) = read["bags"]
    assert counts["n_episodes"] == 6
    assert counts["dropped"]["on the way back from the goal"] >= 6  # commands, of each lap
    files = read_learning_files(Path("decisions.csv"), discount=0.99)
    assert (files.n_after_goal, len(files.reaching)) == (0, 6)
    place = load_scenario(scenario)
    scenario.unlink()  # table and model keep it
    assert serd("learn", "decisions.csv").code == 0
    strategy = load_strategy("model.yaml", place, "optimal")
    assert not strategy.transferred
    driven = serd("navigate", "model.yaml", "--episodes", "2", "--json").values
    assert driven["n_arrived"] == 2
