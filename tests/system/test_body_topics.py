"""Topics of movable obstacles, from a live simulator."""

import pytest
from visualization_msgs.msg import MarkerArray

from serd_cli.processes.node_commands import node_command
from serd_ros.convert.markers import from_obstacle_markers
from serd_ros.endpoints import qos
from storage.yaml_config import model_yaml
from support.movable_obstacles import room

pytestmark = [pytest.mark.ros, pytest.mark.slow]
BEAMS = (
    {"name": "east", "outline_m": [[2.5, 0.1], [2.7, 0.1], [2.7, 2.9], [2.5, 2.9]], "mass_kg": 8.0},
    {
        "name": "north",
        "outline_m": [[0.1, 2.5], [2.4, 2.5], [2.4, 2.7], [0.1, 2.7]],
        "mass_kg": 8.0,
    },
)


def test_the_simulator_publishes_outlines_of_obstacles(nodes, probe, ros_env, tmp_path):
    scenario = tmp_path / "room.yaml"
    scenario.write_text(model_yaml(room(*BEAMS)))
    given = {"scenario": str(scenario), "seed": 1, "lockstep": False}
    shown = []
    probe.node.create_subscription(MarkerArray, "markers/obstacles", shown.append, qos.STATE)
    nodes.start(node_command("hallway_sim", given, {}, ros_env), "hallway_sim")
    probe.spin_until(lambda: shown)
    outlines = from_obstacle_markers(shown[0])
    assert [len(outline) for outline in outlines] == [4, 4]
