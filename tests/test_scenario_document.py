"""docs/scenarios.md: its example is a scenario. docs/scenario_keys.yaml: it has every key."""

import re
from typing import Any

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


def test_the_file_of_keys_has_each_key_with_the_value_that_counts_where_it_is_not_given(
    document, root
):
    keys = (root / "docs" / "scenario_keys.yaml").read_text(encoding="utf-8")
    (example,) = re.findall(r"```yaml\n(.*?)```", document, re.DOTALL)
    given = yaml.safe_load(example)
    assert Scenario(**filled(yaml.safe_load(keys), given)) == Scenario(**given)
    schema = Scenario.model_json_schema()
    parts = [schema, *schema["$defs"].values()]
    names = {key for part in parts for key in part["properties"]}
    assert names == set(re.findall(r"^ *(\w+):", keys, re.MULTILINE))


def filled(keys: Any, given: Any) -> Any:
    """Content of a scenario with the default of each key that it does not give."""
    if isinstance(keys, list) and keys:
        return [filled(keys[0], each) for each in given]
    if not isinstance(keys, dict):
        return given
    defaults = {key: {} if isinstance(value, dict) else value for key, value in keys.items()}
    every = {key: value for key, value in (defaults | given).items() if value is not None}
    return {key: filled(keys[key], value) for key, value in every.items()}
