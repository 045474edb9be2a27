"""A robot without a simulator drives to its goals, and what is missing for it is named.

SERD_ROBOT_GOALS sets the number of goals of each drive, 20 for the long form.
"""

import importlib.util
import os
import re
from itertools import cycle, islice

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from std_msgs.msg import String

from serd_ros.convert.diagnostics import values_of
from serd_ros.endpoints import qos
from support.goals import Goals
from support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
N_GOALS = int(os.environ.get("SERD_ROBOT_GOALS", "3"))
PLACES = [(3.5, 3.5), (4.5, 2.5), (2.5, 3.5), (3.5, 1.5)]
needs_nav2 = pytest.mark.skipif(
    importlib.util.find_spec("nav2_msgs") is None,
    reason="nav2_msgs is not installed; run make interfaces",
)


@pytest.mark.parametrize(
    ("stack", "pose_from", "period_s"),
    [
        pytest.param("robot_nav2", "tf", 0.1, marks=needs_nav2),
        pytest.param("robot_nav2", "amcl_pose", 0.103, marks=needs_nav2),
        ("robot", "tf", 0.103),
        ("robot", "amcl_pose", 0.1),
    ],
)
def test_a_robot_with_stamps_of_its_own_reaches_its_goals(
    stack, pose_from, period_s, nodes, probe, start_robot, save_model_of
):
    goals = Goals(probe)
    follow = "nav2" if stack == "robot_nav2" else "cmd_vel"
    start_robot("--follow", follow, "--period", period_s)
    nodes.start_stack(stack, pose_from=pose_from, model=str(save_model_of()))
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))

    def logs():
        names = ("standin_robot", "strategy", "nav2_bridge" if follow == "nav2" else "guard")
        return "\n".join(nodes.log_of(name) for name in names)

    for place in islice(cycle(PLACES), N_GOALS):
        goals.drive_to(place, logs)
    assert goals.ends == ["arrived"] * N_GOALS
    assert "internal error" not in logs()
    if follow == "nav2":
        found = re.findall(r"goal \d+ turned (\S+)", nodes.log_of("standin_robot"))
        turns_rad = [float(each) for each in found]
        assert len(turns_rad) >= 1
        # By a heading of 0 it would turn by a quarter at each waypoint to the north.
        assert sum(turns_rad) < 0.1 * len(turns_rad)


@pytest.mark.parametrize(
    ("disturbance", "fault"),
    [("jump", "robot_pose: jump"), ("second parent", "robot_pose: stamp too old")],
)
def test_a_robot_whose_tf_is_wrong_stands_and_goes_on_after_a_second_look(
    disturbance, fault, nodes, probe, start_robot, save_model_of
):
    goals, guard, speeds = Goals(probe), {}, []
    start_robot()
    nodes.start_stack("robot", model=str(save_model_of()))
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))

    def take(message):
        guard.update(values_of(message, "guard") or {})

    probe.node.create_subscription(DiagnosticArray, "diagnostics", take, qos.STATE)
    probe.node.create_subscription(Twist, "cmd_vel", lambda m: speeds.append(m.linear.x), qos.STATE)
    disturb = probe.node.create_publisher(String, "disturb", qos.COMMAND)

    def until(condition, text):
        probe.spin_until(
            lambda: disturb.publish(String(data=text)) or condition(),
            seen=lambda: f"{guard} {speeds[-5:]} {nodes.log_of('strategy')}",
        )

    goals.send((3.5, 6.5))
    until(lambda: speeds and speeds[-1] > 0.3, "")
    until(lambda: speeds[-1] == 0.0 and fault in guard["reasons"], disturbance)
    if disturbance == "second parent":
        until(lambda: "must have one parent" in guard["localisation"], disturbance)
        until(lambda: speeds[-1] > 0.1, "")
    else:
        until(lambda: speeds[-1] > 0.1 and not guard["reasons"], disturbance)
