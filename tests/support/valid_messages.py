"""One sound message of every topic that a node subscribes to, at a time of the simulated world."""

from collections.abc import Callable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import OccupancyGrid
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, String

from serd_app.drives.drive import EpisodeMark
from serd_core.grid.grid import Action
from serd_ros.convert import motion, sensors
from serd_ros.convert.diagnostics import UNCOUNTED, to_diagnostics, to_episode_message
from serd_ros.convert.stamp import to_stamp
from serd_ros.convert.typed import to_guard_state
from serd_sim.safety.guard import GuardOutput
from serd_sim.safety.reasons import GuardAction
from serd_sim.scenario.grid import goal_at
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.waypoint import Waypoint
from support.bag_messages import Messages
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
PLACE_M = 3.5, 6.5
GOAL_M = 3.5, 18.5
GOAL = goal_at(HALLWAY, *GOAL_M)


def valid_message(topic: str, time_s: float, message_type: type | None = None) -> Any:
    """The message; message_type: distinguishes Twist and TwistStamped."""
    x_m, y_m = PLACE_M
    observation = observation_at(
        x_m, y_m, 1.5, time_s=time_s, speed_mps=0.4, people=[[4.5, 12.0], [2.5, 9.0]]
    )
    if topic.startswith("cmd_vel"):
        command, is_plain = Command(0.4, 0.1), message_type is Twist
        return motion.to_twist(command) if is_plain else motion.to_twist_stamped(command, time_s)
    # Functions, since a long test of one topic needs the messages of no other.
    messages: dict[str, Callable[[], Any]] = {
        "clock": lambda: Clock(clock=to_stamp(time_s)),
        "robot_pose": lambda: motion.to_pose_stamped(observation.pose, time_s),
        "odom": lambda: motion.to_odometry(observation, (1.0, 2.0, 0.5)),
        "pedestrians": lambda: sensors.to_people_message(observation.people, time_s),
        "scan": lambda: _scan(time_s),
        "intent": lambda: motion.to_intent(Action.NORTH, time_s),
        "waypoint": lambda: motion.to_waypoint_message(Waypoint(x_m, y_m + 1.0), time_s),
        "plan": lambda: motion.to_path(np.array([[x_m, y_m], [x_m, y_m + 1.0]]), time_s),
        "goal_pose": lambda: motion.to_pose_stamped((*GOAL_M, 0.0), time_s),
        "goal_area": lambda: motion.to_goal_area_message(GOAL.goal_area_m, time_s),
        "joy": lambda: motion.to_joy([0.5] * 8, [1] * 12, time_s),
        **dict.fromkeys(("driver_gone", "guard_override", "e_stop", "e_stop_engaged"), Bool),
        "episode": lambda: to_episode_message(
            EpisodeMark("start", time_s, 1, "scripted_expert", 0, "train")
        ),
        "guard_state": lambda: to_guard_state(GuardOutput(STOP, GuardAction.STOP), time_s),
        "diagnostics": lambda: _diagnostics(time_s),
        "map": OccupancyGrid,
        "tf": lambda: Messages().transforms(
            ("map", "odom", (0.5, 0.0, 0.0), 1.0), ("odom", "base_link", (2.0, 0.0, 0.0), 1.0)
        ),
        "model": lambda: String(data="scenario: hallway"),
    }
    return messages[topic]()


def _scan(time_s: float) -> LaserScan:
    """No two scans are equal, as of a real lidar."""
    ranges_m = np.full(HALLWAY.lidar.n_rays, 3.0 + 0.01 * (time_s % 1.0), dtype=np.float32)
    return sensors.to_scan(ranges_m, HALLWAY.lidar, time_s)


def _diagnostics(time_s: float) -> DiagnosticArray:
    counts = {key: float(value) if key.endswith("_m") else 0 for key, value in UNCOUNTED.items()}
    found = to_diagnostics("hallway_sim", time_s, counts)
    found.status += to_diagnostics("teleop_mux", time_s, {"e_stop": False}).status
    found.status += to_diagnostics("demo_recorder", time_s, {"messages": 7}).status
    return found
