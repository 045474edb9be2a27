"""Density of people predicted from a scenario, against that of simulated crowds."""

import numpy as np
import pytest

from serd_app.navigation.evaluation.comparison import predicted_law
from serd_app.navigation.predicted_density import predicted_density
from serd_app.navigation.strategy import load_strategy
from serd_core.grid.density import DENSITY_MODEL_NAMES, crowd_shares
from sim.crowd.crowd import start_crowd
from sim.scenario.grid import grid_of
from sim.scenario.scenario import load_scenario
from storage.model_file import OutcomeModel
from tests.conftest import OUTCOMES


def measured(scenario, n_seeds: int) -> np.ndarray:
    """(S,) mean over 5 moments of 40 s of each of some crowds."""
    centers_m, fields = grid_of(scenario).centers_m, []
    for seed in range(n_seeds):
        crowd = start_crowd(
            scenario.pedestrians,
            scenario.directed_loops,
            scenario.wall_segments_m,
            np.random.default_rng(seed),
        )
        for step in range(500):
            crowd.step(0.08)
            if step % 100 == 99:
                people_m = np.stack([crowd.x_m, crowd.y_m], axis=1)
                fields.append(crowd_shares(centers_m, people_m).sum(axis=1))
    return np.mean(fields, axis=0)


@pytest.mark.parametrize(("people", "least"), [(30, 0.8), (90, 0.7)])
def test_cells_of_the_hallway_have_the_density_of_simulated_crowds(people, least):
    scenario = load_scenario("hallway").with_pedestrian_count(people)
    predicted, found = predicted_density(scenario, grid_of(scenario)), measured(scenario, 6)
    assert predicted.mean() == pytest.approx(found.mean(), rel=0.05)
    assert np.corrcoef(predicted, found)[0, 1] > least
    # Chance of the 30 moments included.
    assert np.sqrt(np.mean((predicted - found) ** 2)) < 0.35 * found.mean()


def test_density_grows_with_the_people_and_is_0_without():
    scenario = load_scenario("hallway")
    grid = grid_of(scenario)
    some, twice = (
        predicted_density(scenario.with_pedestrian_count(count), grid) for count in (24, 48)
    )
    np.testing.assert_allclose(twice, 2 * some, rtol=1e-12)
    assert not predicted_density(scenario.with_pedestrian_count(0), grid).any()


def test_the_direction_of_the_flow_does_not_matter():
    scenario = load_scenario("hallway")
    grid = grid_of(scenario)
    other = scenario.model_copy(update={"flow_convention": "left_hand"})
    np.testing.assert_allclose(
        predicted_density(other, grid), predicted_density(scenario, grid), atol=2e-3
    )


def test_a_model_that_depends_on_density_plans_for_the_people_of_the_scenario(save_model_of):
    """At 1 person per m² half of the moves fail."""
    held = {name: (0.45 + row[0] / 2, *np.array(row[1:]) / 2) for name, row in OUTCOMES.items()}
    held = {name: np.array(row) / sum(row) for name, row in held.items()}
    rows = dict(zip(DENSITY_MODEL_NAMES, (*OUTCOMES.values(), *held.values()), strict=True))
    path = str(
        save_model_of(
            outcome_models=tuple(
                OutcomeModel(name=name, learned=row, believed=row, initial=row)
                for name, row in rows.items()
            )
        )
    )
    hallway, medians_s = load_scenario("hallway"), []
    for people in (1, 24, 140):
        scenario = hallway.with_pedestrian_count(people)
        medians_s.append(predicted_law(load_strategy(path, scenario, "optimal"), "train"))
    medians_s = [law.quantile_s(0.5) for law in medians_s]
    assert medians_s == sorted(medians_s)
    assert medians_s[-1] > 1.2 * medians_s[0]
    table = save_model_of(name="table.yaml")
    without = predicted_law(load_strategy(str(table), hallway, "optimal"), "train")
    assert medians_s[0] == pytest.approx(without.quantile_s(0.5), abs=2.0)
