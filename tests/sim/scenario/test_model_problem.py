"""Which weights of a model count in a place, with people and without."""

import numpy as np
import pytest

from serd_bag.errors import FileError
from serd_files.grid_file import flow_picture
from serd_files.model_file import load_model
from serd_sim.drivers.strategy import model_in_flow, problem_of_model
from serd_sim.scenario.grid import flow_of, grid_of
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
FLOW = flow_of(HALLWAY, GRID)
NO_FLOW = np.full_like(FLOW, -1)
WITHOUT_NORM = ("goal", "inverse_wall_distance")


def planned(path, scenario=HALLWAY, **options):
    return problem_of_model(str(path), load_model(path), scenario, GRID, **options)


def test_the_weight_of_the_social_norm_counts_among_people_only(save_model_of):
    path = save_model_of()
    problem, model = planned(path)
    assert model == load_model(path)
    assert problem.feature_names == model.feature_names
    problem, model = planned(path, HALLWAY.with_pedestrian_count(0))
    assert problem.feature_names == model.feature_names == WITHOUT_NORM


@pytest.mark.parametrize("transferred", [False, True])
def test_the_norm_of_a_model_learned_without_flow_is_that_of_waiting_and_counts_nowhere(
    save_model_of, transferred
):
    path = save_model_of(flow=flow_picture(GRID, NO_FLOW))
    problem, model = planned(path, transferred=transferred)
    assert model.feature_names == problem.feature_names == WITHOUT_NORM
    assert (problem.flow == (FLOW if transferred else NO_FLOW)).all()


def test_a_flow_of_the_model_s_own_keeps_the_norm_also_where_the_scenario_has_none(save_model_of):
    path = save_model_of(flow=flow_picture(GRID, FLOW))
    problem, _ = planned(path, HALLWAY.with_pedestrian_count(0))
    assert "social_norm" in problem.feature_names
    assert model_in_flow(load_model(path), NO_FLOW).feature_names == WITHOUT_NORM


def test_a_model_of_the_norm_alone_is_refused_where_there_is_none(save_model_of):
    path = save_model_of(reward_weights={"social_norm": 1.0})
    with pytest.raises(FileError, match=rf"{path.name}: features must name at least one .*again"):
        planned(path, HALLWAY.with_pedestrian_count(0))
