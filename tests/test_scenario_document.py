"""docs/scenarios.md: its example is a scenario, and it names every key.

That its tables are those of the models is tested in tools/test_write_reference.py.
"""

import re

import pytest

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


def test_it_names_every_key(document):
    schema = Scenario.model_json_schema()
    keys = set(schema["properties"])
    for part in schema["$defs"].values():
        keys |= set(part["properties"])
    missing = {key for key in keys if f"`{key}`" not in document}
    assert not missing
