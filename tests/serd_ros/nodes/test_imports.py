"""Nodes import what they need only, for a stack starts half a dozen of them at once."""

from serd_ros.graph.graph import module_of
from support.processes import outputs_of_processes

_NODES = (
    "hallway_sim", "guard", "local_planner", "scripted_expert", "demo_recorder", "teleop_mux",
)  # fmt: skip


def test_nodes_with_a_scenario_load_no_package_of_scipy():
    lines = [
        "import sys", *(f"import {module_of(node)}" for node in _NODES),
        "from serd_sim.scenario.scenario import load_scenario", 'load_scenario("t_junction")',
        "print(*sys.modules)",
    ]  # fmt: skip
    (output,) = outputs_of_processes("\n".join(lines), count=1)
    loaded = set(output.split())
    assert "serd_sim.scenario.scenario" in loaded
    packages = {"sparse", "ndimage", "spatial", "special", "linalg", "optimize"}
    assert not loaded & {f"scipy.{package}" for package in packages}
