"""Names of the version before answer where they went."""

import pytest

from serd_app.drives.mapping import BagMapping, TableMapping
from serd_app.journeys.navigate import BegunDrive
from serd_bag.errors import FileError
from serd_cli.app import make_app, run
from serd_files.yaml_config import model_yaml, yaml_model
from serd_ros.errors import NodeError
from serd_ros.graph.graph import addressees, find_stack
from serd_sim.scenario.scenario import Scenario, load_scenario
from support.commands import work_in_empty_folder


@pytest.mark.parametrize(
    ("words", "went"),
    [
        (["learn", "decisions.csv", "--times", "crossings.csv"], "learns how long moves take"),
        (["navigate", "model.yaml", "--lookahead", "2"], "waypoints are straight ahead"),
        (["launch", "--list"], "lists the stacks where no name follows"),
        (["demo", "--no-page"], "always have their page"),
        (["episode", "render", "hallway"], "serd scenario film"),
    ],
)
def test_a_command_says_where_it_went(monkeypatch, tmp_path, capsys, words, went):
    work_in_empty_folder(monkeypatch, tmp_path)
    monkeypatch.setattr("sys.argv", ["serd", *words])
    try:
        code = run(make_app())
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert went in capsys.readouterr().err.replace("\n", " ")


def test_a_parameter_says_where_it_went():
    with pytest.raises(NodeError, match="it is called patience_decisions"):
        addressees(find_stack("navigate"), "patience_periods")


@pytest.mark.parametrize(
    ("key", "model_class", "went"),
    [
        ("decision_period_s: 2.0", Scenario, "may have patience_s and wait_s instead"),
        ("button_topic: joy", BagMapping, "goal_area_m and stop_s cut episodes"),
        ("people: people.csv", TableMapping, "one table holds robot and people"),
        ("planner: teb", BegunDrive, "there is one local planner; delete the key"),
    ],
)
def test_a_key_says_where_it_went(key, model_class, went):
    base = model_yaml(load_scenario("hallway")) if model_class is Scenario else ""
    with pytest.raises(FileError, match=went):
        yaml_model(f"{base}{key}\n", model_class, name="a.yaml")
