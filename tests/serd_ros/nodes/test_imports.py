"""Nodes import what they need only, for a stack starts half a dozen of them at once."""

import subprocess
import sys

import pytest

from serd_ros.graph.graph import module_of

_LOADED = """
import sys
import {module}
from serd_sim.scenario.scenario import load_scenario
load_scenario("t_junction")
print(*sys.modules)
"""


@pytest.mark.parametrize(
    "node",
    ["hallway_sim", "guard", "local_planner", "scripted_expert", "demo_recorder", "teleop_mux"],
)
def test_a_node_with_a_scenario_loads_no_package_of_scipy(node: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _LOADED.format(module=module_of(node))],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = set(done.stdout.split())
    assert "serd_sim.scenario.scenario" in loaded
    packages = {"sparse", "ndimage", "spatial", "special", "linalg", "optimize"}
    assert not loaded & {f"scipy.{package}" for package in packages}
