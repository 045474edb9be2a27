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
from serd_ros.graph.graph import find_stack
from support.goals import Goals
from support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
N_GOALS = int(os.environ.get("SERD_ROBOT_GOALS", "2"))
PLACES = [(3.5, 3.5), (4.5, 2.5), (2.5, 3.5), (3.5, 1.5)]
SECOND = "second parent"
needs_nav2 = pytest.mark.skipif(
    importlib.util.find_spec("nav2_msgs") is None,
    reason="nav2_msgs is not installed; run make interfaces",
)


@pytest.mark.parametrize(
    ("stack", "period_s"),
    [pytest.param("robot_nav2", 0.1, marks=needs_nav2), ("robot_people", 0.103)],
)
def test_a_robot_with_stamps_of_its_own_reaches_its_goals(
    stack, period_s, nodes, probe, start_robot, save_model_of
):
    goals = Goals(probe)
    follow = "nav2" if stack == "robot_nav2" else "cmd_vel"
    people = ["--people"] if stack == "robot_people" else []
    start_robot("--follow", follow, "--period", period_s, *people)
    nodes.start_stack(stack, model=str(save_model_of()))
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))

    def logs():
        return "\n".join(nodes.log_of(name) for name in ("standin_robot", *find_stack(stack).nodes))

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


def test_a_robot_whose_tf_is_wrong_stands_and_goes_on_after_a_second_look(
    nodes, probe, start_robot, save_model_of
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

    goals.send((3.5, 12.5))
    until(lambda: speeds and speeds[-1] > 0.3, "")
    until(lambda: speeds[-1] == 0.0 and "robot_pose: jump" in guard["reasons"], "jump")
    until(lambda: speeds[-1] > 0.1 and not guard["reasons"], "jump")

    until(lambda: speeds[-1] == 0.0 and "robot_pose: stamp too old" in guard["reasons"], SECOND)
    until(lambda: "must have one parent" in guard["localisation"], SECOND)
    until(lambda: speeds[-1] > 0.1, "")
