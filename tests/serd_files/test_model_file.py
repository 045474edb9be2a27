"""Model files: exact round trip, refusal of another grid, sentences for what is wrong."""

import dataclasses

import numpy as np
import pytest

from serd_bag.errors import FileError
from serd_core.grid.grid import Grid
from serd_files.model_file import (
    FitRecord,
    GridSummary,
    ModelDraws,
    ModelFile,
    OutcomeModel,
    load_model,
    require_grid,
)
from serd_files.yaml_config import save_yaml_model

GRID = Grid((0.0, 0.0), 1.0, np.ones((2, 3), dtype=bool))
ROW, STAY = (0.1, 0.6, 0.1, 0.1, 0.1), (1.0, 0.0, 0.0, 0.0, 0.0)
#: Draws of the one law: waiting has none.
TIMES = {"mean_s": ((1.1,),), "shape": ((4.5,),)}


def model(**changes):
    """A small model."""
    values = {
        "scenario": "hallway",
        "method": "MDCE-SERD",
        "prior": "KLD, weight 1",
        "discount": 0.99,
        "beta": 1.0,
        "patience_s": 4.0,
        "reward_weights": {"goal": 1 / 3, "social_norm": -1e-5},
        "outcome_names": ("stay", "forward", "right", "back", "left"),
        "outcome_models": (
            OutcomeModel(
                name="with_flow", learned=ROW, believed=ROW[::-1], initial=(0.2,) * 5,
                mean_s=1 / 3, believed_mean_s=0.7, shape=6.1,
            ),
            OutcomeModel(
                name="waiting", learned=STAY, believed=STAY, initial=STAY, mean_s=1.2,
                believed_mean_s=1.2,
            ),
        ),
        "grid": GridSummary.of(GRID),
        "fit": FitRecord(
            converged=True, message="ok", n_episodes=2, n_decisions=9, objective=-1.5,
            policy_log_likelihood=-1.0, dynamics_log_likelihood=-0.5, log_prior=0.0,
            gradient_norm=1e-9, n_steps=3, n_evaluations=4,
        ),
    }  # fmt: skip
    return ModelFile(**(values | changes))


def test_a_model_survives_a_round_trip_with_its_draws_and_paces(tmp_path):
    draws = ModelDraws(
        reward_weights=((1 / 3, 2.0), (0.1, -1e-7)),
        learned=((ROW, STAY), (ROW[::-1], STAY)),
        mean_s=((1 / 7,), (2.0,)),
        shape=((0.3,), (1e3,)),
    )
    saved = model(draws=draws, pace=(1 / 3, 1.0, 1.0, 0.5, 2.0, 1.0))
    save_yaml_model(tmp_path / "model.yaml", saved)
    loaded = load_model(tmp_path / "model.yaml")
    require_grid("model.yaml", loaded, GRID)
    assert loaded == saved
    assert loaded.feature_names == ("goal", "social_norm")
    assert loaded.weights.tolist() == [1 / 3, -1e-5]
    assert loaded.outcome_probabilities.tolist() == [list(ROW), list(STAY)]
    assert loaded.believed_outcome_probabilities.tolist() == [list(ROW[::-1]), list(STAY)]
    assert loaded.initial_outcome_probabilities.tolist() == [[0.2] * 5, list(STAY)]
    assert loaded.wait_s == 1.2


def test_a_feature_that_does_not_count_leaves_weights_and_draws_together():
    draws = ModelDraws(reward_weights=((1.0, 2.0),), learned=((ROW, STAY),), **TIMES)
    whole = model(draws=draws)
    left = whole.with_features(("goal", "inverse_wall_distance"))
    assert left.reward_weights == {"goal": 1 / 3}
    assert left.draws.reward_weights == ((1.0,),)
    assert left.draws == draws.model_copy(update={"reward_weights": ((1.0,),)})
    assert ModelFile(**left.model_dump()) == left
    assert whole.with_features(("social_norm", "goal")) is whole


@pytest.mark.parametrize(
    ("flow", "without"), [((), False), (("#..", "..."), True), (("#..", ".>."), False)]
)
def test_a_model_was_learned_without_flow_where_its_picture_has_no_direction(flow, without):
    assert model(flow=flow).without_flow == without


def with_draws(**changes):
    values = {"reward_weights": ((1.0, 2.0),), "learned": ((ROW, STAY),), **TIMES, **changes}
    return model(draws=ModelDraws(**values))


@pytest.mark.parametrize(
    ("make", "changes", "sentence"),
    [
        (with_draws, {"learned": ()}, "as many reward_weights as learned, mean_s and shape"),
        (with_draws, {"shape": ()}, "as many reward_weights as learned, mean_s and shape"),
        (with_draws, {"reward_weights": ((1.0,),)}, "a weight per feature"),
        (with_draws, {"learned": ((ROW,),)}, "a row per outcome model"),
        (with_draws, {"learned": (((0.5, 0.6, 0, 0, 0), STAY),)}, "must sum to 1, got 1.1"),
        (with_draws, {"learned": (((0.5, 0.5), STAY),)}, "one probability per outcome"),
        (with_draws, {"mean_s": ((1.0, 1.0),)}, "draws.shape must have a number per law"),
        (with_draws, {"shape": ((),)}, "draws.mean_s and draws.shape must have a number per law"),
        (model, {"pace": (1.0, 2.0)}, r"pace must have a number per cell \(6\)"),
    ],
)
def test_draws_and_paces_that_do_not_fit_the_model_are_rejected(make, changes, sentence):
    make()
    with pytest.raises(ValueError, match=sentence):
        make(**changes)


@pytest.mark.parametrize(
    ("changes", "difference"),
    [
        ({"cell_size_m": 0.5}, "cell_size_m 1.0 there, 0.5 here"),
        ({"walkable": np.ones((2, 4), dtype=bool)}, "columns 3 there, 4 here, n_states 6 there, 8"),
        ({"walkable": np.eye(2, 3) == 0}, "n_states 6 there, 4 here"),
    ],
)
def test_a_model_of_another_grid_is_refused_with_the_difference(changes, difference):
    other = dataclasses.replace(GRID, **changes)
    with pytest.raises(FileError, match=f"was made for another grid .*{difference}"):
        require_grid("model.yaml", model(), other)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("serd-model", "serd-grid", "format must be 'serd-model', got 'serd-grid'"),
        ("version: 2", "version: 3", "format_version must be 2, got 3 of another version"),
        # Keys of such a model that left are not what is wrong with it.
        (
            "version: 2",
            "version: 1\nperiod_s: 2",
            "must be 2, got 1 of another version; run 'serd d",
        ),
        ("patience_s: 4.0", "patience_s: 0.0", "patience_s must be greater than 0, got 0.0"),
        ("mean_s: 1.2", "mean_s: -1.0", r"outcome_models\[1\].mean_s must be greater than 0"),
        ("shape: 6.1", "shape: 0.0", r"outcome_models\[0\].shape must be greater than 0"),
        ("beta: 1.0", "beta: 0.0", "beta must be greater than 0, got 0.0"),
        ("discount: 0.99", "discont: 0.99", "discont is not a known key; did you mean 'discount'"),
        ("0.6", "0.7", "with_flow.learned must sum to 1"),
        (": with_flow", ": with_flow_at_1", "waiting, got 'with_flow_at_1'; learn the model again"),
        ("0.3333333333333333", ".nan", "reward_weights.goal must be a finite number"),
    ],
)
def test_a_wrong_model_gets_a_sentence(tmp_path, old, new, sentence):
    path = tmp_path / "model.yaml"
    save_yaml_model(path, model())
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(FileError, match=sentence):
        load_model(path)
