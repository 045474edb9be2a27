"""Journeys return records of what they made, and refuse before they write."""

from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import Place, save_learnable
from serd_app.errors import AppError
from serd_app.journeys import learn as learning
from serd_app.journeys.demonstrate import PlaceChoice
from serd_app.journeys.from_map import scenario_from_map
from serd_app.journeys.learn import learn_from_table
from serd_app.journeys.navigate import navigate
from serd_app.learning.knowledge import certainty_of
from serd_app.learning.recipe import learn
from serd_app.learning.settings import LearningSettings
from serd_app.navigation.settings import DriveSettings
from serd_app.places.settings import PlaceSettings
from serd_sim.errors import SimError
from serd_sim.scenario.scenario import load_scenario
from support.episodes import episode_result
from support.ros_maps import maze, write_map
from support.timed_hallway import TASK, timed_decisions


def test_episodes_that_any_driver_gives_are_compared_with_the_plan(save_model_of):
    settings = DriveSettings(model=str(save_model_of()), episodes=3)
    asked, times_s = [], (25.0, 28.0)

    def drive(given, output, navigator):
        asked.append((given, output, navigator.model))
        arrived = [episode_result(i, "arrived", time_s) for i, time_s in enumerate(times_s)]
        return [*arrived, episode_result(2, "timeout")]

    done = navigate(settings, None, drive)
    assert asked == [(settings, None, settings.model)]
    assert (done.comparison.n_episodes, done.comparison.n_arrived) == (3, 2)
    assert done.settings is settings
    assert done.missing == ""


def test_nothing_drives_from_a_start_area_that_is_not_there(save_model_of):
    settings = DriveSettings(model=str(save_model_of()), start_area="nowhere")
    with pytest.raises(SimError, match="start area must be one of train, transfer"):
        navigate(settings, None, lambda *_: pytest.fail("it drove"))


@pytest.mark.usefixtures("quick_pictures")
def test_a_scenario_of_a_map_is_on_disk_as_in_the_record(tmp_path):
    source = write_map(tmp_path, "maze", maze(cells=6))
    settings = PlaceSettings(robot_radius_m=0.15, cell_size_m=0.4)
    file = tmp_path / "new.yaml"
    made = scenario_from_map(source, file, settings)
    assert load_scenario(file) == made.scenario
    assert made.picture.read_bytes().startswith(b"\x89PNG")
    file.write_text(file.read_text().replace("count: 0", "count: 0  # nights only"))
    with pytest.raises(AppError, match=r"new\.yaml must not be replaced without --output"):
        scenario_from_map(source, file, settings)
    assert scenario_from_map(source, file, settings, replace=True).scenario == made.scenario


@pytest.mark.parametrize(
    ("choice", "sentence"),
    [
        ({"scenario": "hallway", "cell_size_m": 1.0}, "either --scenario or --cell-size-m"),
        ({"scenario": "hallway", "area": Path("a.wkt")}, "either --scenario or --area"),
        ({"cell_size_m": float("nan")}, "--cell-size-m must be finite and above 0, got nan"),
        ({"area": Path("a.txt")}, "must end in .wkt, .geojson, .json"),
    ],
)
def test_a_place_is_a_scenario_or_a_grid_that_is_fitted(choice, sentence):
    with pytest.raises(AppError, match=sentence):
        PlaceChoice(**choice)


def test_standard_errors_are_of_the_decisions_that_the_recipe_used(monkeypatch, tmp_path):
    def of_one_episode(task, decisions, *others):
        return learn(task, decisions.select_episodes(decisions.episodes[:1]), *others)

    monkeypatch.setattr(learning, "learn", of_one_episode)
    scenario, table = load_scenario("hallway"), tmp_path / "decisions.csv"
    place = Place(TASK.problem.grid, scenario.patience_s, scenario.wait_s, scenario)
    save_learnable(table, place, timed_decisions())
    settings = LearningSettings(method="mdce_serd", prior_weights=(1.0,))
    learned = learn_from_table(table, tmp_path / "model.yaml", settings)
    outcome = learned.outcome
    assert 0 < len(outcome.decisions) < len(learned.files.decisions)
    used = certainty_of(outcome.problem, outcome.decisions, outcome.fit)
    assert np.isfinite(used.errors.reward).all()
    np.testing.assert_array_equal(learned.certainty.errors.reward, used.errors.reward)
