"""The node of docs/how_to/own_parts.md publishes what local_planner takes."""

import math
import re

import pytest
import rclpy
from domain_coordinator import domain_id

from serd_core.grid.grid import Action
from serd_ros.convert.motion import from_intent
from serd_sim.scenario.scenario import load_scenario
from support.nodes_in_process import deliver
from support.valid_messages import valid_message


@pytest.fixture
def ros():
    with domain_id() as domain:
        rclpy.init(domain_id=int(domain))
        yield
        rclpy.try_shutdown()


@pytest.mark.usefixtures("ros")
def test_the_driver_decides_now_and_then_with_the_stamp_of_the_pose(root):
    page = (root / "docs/how_to/own_parts.md").read_text(encoding="utf-8")
    names = {"math": math, "scenario": load_scenario("corridor")}
    exec(re.findall(r"```python\n(.*?)```", page, re.S)[-1], names)
    node, sent = names["NorthNode"](), []
    node.intents.publish = sent.append
    (poses,) = node.subscriptions
    for time_s in (10.0, 10.05, 10.45, 10.5, 10.55, 3.0):
        deliver(poses, valid_message("robot_pose", time_s))
    expected = [(round(time_s * 1e9), Action.NORTH) for time_s in (10.0, 10.5, 3.0)]
    assert [from_intent(each) for each in sent] == expected
    node.destroy_node()
