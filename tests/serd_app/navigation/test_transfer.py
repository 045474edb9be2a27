"""Which model files are usable in which scenario, and the errors of the others."""

import numpy as np
import pytest

from serd_app.navigation.strategy import load_strategy
from serd_bag.errors import FileError
from serd_files.model_file import GridSummary, OutcomeModel, load_model
from serd_sim.scenario.scenario import builtin_scenarios, load_scenario

HALLWAY = load_scenario("hallway")


def test_a_model_of_another_place_is_refused_unless_transfer_is_wanted(save_model_of):
    path = str(save_model_of("corridor"))
    with pytest.raises(FileError, match="was made for another grid of the scenario 'corridor'"):
        load_strategy(path, HALLWAY, "optimal", transfer=False)
    assert load_strategy(path, HALLWAY, "optimal", transfer=True).transferred
    assert not load_strategy(path, load_scenario("corridor"), "optimal", transfer=True).transferred


@pytest.mark.parametrize("there", builtin_scenarios())
@pytest.mark.parametrize("here", builtin_scenarios())
def test_a_model_of_any_scenario_leads_to_the_goal_in_any_other(there, here, save_model_of):
    path = str(save_model_of(there))
    strategy = load_strategy(path, load_scenario(here), "optimal", transfer=True)
    assert strategy.transferred == (there != here)
    assert len(strategy.traps.states) == 0
    assert np.allclose(strategy.arrival.arrival_probability, 1.0)


def test_outcome_models_and_outcomes_are_found_by_name_whatever_their_order(save_model_of):
    usual = load_model(save_model_of())
    turned = tuple(
        OutcomeModel(
            name=each.name,
            learned=each.learned[::-1],
            believed=each.believed[::-1],
            initial=each.initial[::-1],
        )
        for each in usual.outcome_models[::-1]
    )
    path = save_model_of(
        name="turned.yaml", outcome_models=turned, outcome_names=usual.outcome_names[::-1]
    )
    found = load_strategy(str(path), HALLWAY, "optimal", transfer=False)
    assert np.array_equal(found.outcome_probabilities, usual.outcome_probabilities)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"reward_weights": {"goal": 1.0, "noise_level": 2.0}},
            "features must be among goal, social_norm, inverse_wall_distance, got 'noise_level'",
        ),
        ({"decision_period_s": 1.0}, "decision periods of 1 s, but 'hallway' has 2 s"),
        (
            {"outcome_names": ("stay", "forward", "right", "back", "spin")},
            "outcome_names must have stay, forward, right, back, left, but 'left' is missing",
        ),
    ],
)
def test_what_cannot_be_used_is_said_with_the_file(changes, sentence, save_model_of):
    path = save_model_of(**changes)
    with pytest.raises(FileError, match=f"{path.name}: .*{sentence}"):
        load_strategy(str(path), HALLWAY, "optimal", transfer=True)


def test_cells_of_another_size_are_refused(save_model_of):
    grid = load_model(save_model_of()).grid
    coarse = GridSummary(**{**grid.model_dump(), "cell_size_m": 2.0, "fingerprint": "other"})
    path = save_model_of(name="coarse.yaml", grid=coarse)
    with pytest.raises(FileError, match="learned with cells of 2 m, but 'hallway' has 1 m"):
        load_strategy(str(path), HALLWAY, "optimal", transfer=True)
