"""Names of the version before answer where they went."""

import json

import pytest

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
        (["faults", "--seeds", "3"], "python -m lab faults"),
        (["study", "hallway"], "python -m lab lists"),
        (["experiment", "gridworld"], "python -m lab lists"),
        (["crowd", "compare"], "python -m lab crowd"),
        (["learn", "decisions.csv", "--experts", "2"], "serd_core.choose_expert_types"),
        (["demos", "bag", "--lerobot", "folder"], "has left"),
        (["learn", "decisions.csv", "--density"], "it improved no forecast"),
        (["navigate", "model.yaml", "--expert=2"], "serd_core.choose_expert_types"),
        (["learn", "decisions.csv", "--times", "crossings.csv"], "learns how long moves take"),
        (["navigate", "model.yaml", "--lookahead", "2"], "waypoints are straight ahead"),
        (["teleop", "--keyboard"], "any publisher of cmd_vel_teleop"),
        (["run", "serd_ros", "foxglove_server"], "foxglove_bridge"),
        (["launch", "--list"], "lists the stacks where no name follows"),
        (["demo", "--no-page"], "always have their page"),
        (["episode", "render", "hallway"], "serd scenario film"),
        (["scenario", "film", "--frames-per-s", "5"], "10 frames per second"),
        (["scenario", "film", "--pixels-per-m", "5"], "24 pixels per metre"),
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
    with pytest.raises(NodeError, match="namespace:=robot1"):
        addressees(find_stack("navigate"), "robots")


def with_pillar(**more):
    """The hallway with an obstacle that has more keys, as text."""
    pillar = {"name": "pillar", "outline_m": [[2.8, 8.0], [3.2, 8.0], [3.2, 8.4]], **more}
    return model_yaml(load_scenario("hallway")).replace(
        "obstacles: []\n", f"obstacles: {json.dumps([pillar])}\n"
    )


def test_a_key_says_where_it_went():
    with pytest.raises(FileError, match="every obstacle is a wall now"):
        yaml_model(with_pillar(mass_kg=3.0), Scenario, name="place.yaml")
    with pytest.raises(FileError, match="no node read it"):
        yaml_model(with_pillar() + "imu: {gyroscope_bias_walk: 1.0}\n", Scenario, name="a.yaml")
    with pytest.raises(FileError, match="may have patience_s and wait_s instead"):
        yaml_model(with_pillar() + "decision_period_s: 2.0\n", Scenario, name="a.yaml")


def test_a_scenario_that_the_version_before_wrote_is_read():
    older = with_pillar(mass_kg=None, hinge_m=None) + (
        "imu: {gyroscope_noise_density: 1.7e-4, gyroscope_bias_walk: 1.9e-5,"
        " accelerometer_noise_density: 2.0e-3, accelerometer_bias_walk: 3.0e-3}\n"
    )
    now = yaml_model(with_pillar(), Scenario, name="place.yaml")
    assert yaml_model(older, Scenario, name="place.yaml") == now
