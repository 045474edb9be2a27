"""Each reference robot on each stack of a robot: a goal, and a fault. The lab runs more of both."""

import importlib.util
import math

import pytest

from lab.faults.field import STACKS, Field, parameters_of, standin_options
from lab.faults.robots import ROBOTS
from serd_sim.safety.scan import ScanGeometry
from support.node_processes import STANDIN

pytestmark = [pytest.mark.ros, pytest.mark.slow]
NO_NAV2 = importlib.util.find_spec("nav2_msgs") is None


def test_the_lidars_are_those_of_the_robots_that_they_stand_for():
    assert ROBOTS["short_range"].geometry == ScanGeometry(-math.pi, math.tau / 360, 0.12, 3.5)
    assert ROBOTS["fast"].geometry.angles_rad(1081)[[0, -1]] == pytest.approx(
        [-0.75 * math.pi, 0.75 * math.pi], abs=1e-4
    )


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("stack", STACKS)
def test_a_reference_robot_reaches_a_goal_and_stands_when_its_scans_stop(
    stack, robot, nodes, probe, tmp_path, save_model_of
):
    if stack == "robot_nav2" and NO_NAV2:
        pytest.skip("nav2_msgs is not installed; run make interfaces")
    nodes.start([*STANDIN, *standin_options(robot, stack)], "standin_robot")
    scenario = ROBOTS[robot].save_scenario(tmp_path)
    for name, given in parameters_of(stack, scenario, save_model_of()).items():
        named = {key.replace(".", "__"): value for key, value in given.items()}
        nodes.start_stack(name, namespace=f"/{robot}", **named)
    seen = Field(probe.node, probe.spin_once, f"/{robot}")

    def until(condition):
        logs = lambda: f"{seen.measured} {seen.guard} {nodes.log_of('strategy')}"  # noqa: E731
        probe.spin_until(condition, seen=logs)

    until(lambda: "waiting for a goal" in nodes.log_of("strategy") and seen.measured)
    assert seen.send_goal(3.5, 3.5)
    until(lambda: seen.endings)
    assert seen.endings == ["arrived"]
    assert seen.send_goal(3.5, 12.5)
    until(lambda: seen.measured["speed_mps"] > 0.1)
    assert seen.send_goal(3.5, 11.5), "the drive that runs leads to it"
    seen.disturb("scan_stops")
    until(lambda: seen.measured["stood_s"] is not None)
    until(lambda: "scan: stamp too old" in seen.guard["reasons"])
    seen.disturb("")
    until(lambda: seen.measured["speed_mps"] > 0.1)
    assert not any(seen.measured[each] for each in ("wall", "robot_on_person"))
    # By a heading of 0 it would turn by a quarter at each waypoint to the north.
    assert seen.measured.get("turned_rad", 0.0) <= 0.1 * seen.measured.get("nav2_goals", 0)
