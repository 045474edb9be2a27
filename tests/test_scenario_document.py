"""docs/scenarios.md: its example is a scenario. docs/scenario_keys.yaml: it has every key."""

import re

import pytest
import yaml

from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import Scenario, load_scenario


@pytest.fixture(scope="module")
def document(root):
    return (root / "docs" / "scenarios.md").read_text(encoding="utf-8")


def test_its_example_and_its_parameters_of_the_planner_are_a_scenario(document, tmp_path):
    (example,) = re.findall(r"```yaml\n(.*?)```", document, re.DOTALL)
    (block,) = re.findall(r"```text\n(local_planner:\n.*?)```", document, re.DOTALL)
    path = tmp_path / "room.yaml"
    path.write_text(example + block)
    room = load_scenario(path)
    assert (room.pedestrians.count, room.local_planner.max_vel_x) == (12, 0.8)
    grid = navigation_problem_of(room, 0.99).grid
    table = grid.state_at(4.6, 5.0), grid.state_at(6.0, 5.0)
    assert table == (-1, -1), "the cells of the table are not walkable"
    assert grid.n_states == 12 * 10 - 4 * 2


def test_the_file_of_keys_has_each_key_and_the_defaults(root):
    text = (root / "docs" / "scenario_keys.yaml").read_text(encoding="utf-8")
    schema = Scenario.model_json_schema()
    names = {key for part in (schema, *schema["$defs"].values()) for key in part["properties"]}
    assert names == set(re.findall(r"^ *(\w+):", text, re.MULTILINE))
    content = yaml.safe_load(text)
    content["pedestrians"]["loops"] = []
    for name in ("pedestrians", "robot", "lidar", "odometry", "local_planner"):
        part = Scenario.model_fields[name].annotation
        assert part(**content[name]) == part()
