"""Strategies of model files: the plan, its arrival, other places, draws of a posterior."""

import numpy as np
import pytest

from serd_bag.errors import FileError
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.policies.solved_policy import optimal_policy
from serd_core.semi_markov.models import require_timed
from serd_files.model_file import ModelDraws, load_model
from serd_sim.drivers.strategy import STEP_S, load_strategy, start_distribution
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from tests.conftest import MEAN_S, OUTCOMES, model_row

HALLWAY, PLACES = load_scenario("hallway"), builtin_scenarios()
ROWS = tuple(model_row(name, row) for name, row in OUTCOMES.items())


def paced(path):
    """(S,) paces of a model's cells, which alternate."""
    n_states = load_model(path).grid.n_states
    return tuple(np.where(np.arange(n_states) % 2, 0.5, 2.0).tolist())


def test_a_model_of_another_place_is_refused_unless_transfer_is_wanted(save_model_of):
    path = str(save_model_of("corridor"))
    with pytest.raises(FileError, match="was made for another grid of the scenario 'corridor'"):
        load_strategy(path, HALLWAY, "optimal", transfer=False)
    grid = load_model(path).grid.model_copy(update={"cell_size_m": 2.0, "fingerprint": "other"})
    coarse = str(save_model_of(name="coarse.yaml", grid=grid))
    with pytest.raises(FileError, match="learned with cells of 2 m, but 'hallway' has 1 m"):
        load_strategy(coarse, HALLWAY, "optimal", transfer=True)
    assert load_strategy(path, HALLWAY, "optimal", transfer=True).transferred
    assert not load_strategy(path, load_scenario("corridor"), "optimal", transfer=True).transferred


@pytest.mark.parametrize("place", range(len(PLACES)))
def test_a_model_of_a_scenario_leads_to_the_goal_in_another(place, save_model_of):
    path, here = str(save_model_of(PLACES[place])), load_scenario(PLACES[place - 1])
    strategy = load_strategy(path, here, "optimal", transfer=True)
    assert strategy.transferred
    assert len(strategy.traps.states) == 0
    assert np.allclose(strategy.arrival.arrival_probability, 1.0)


def test_the_law_of_arrival_is_that_of_simulated_drives_whose_dwell_times_are_not_rounded(
    save_model_of,
):
    path = save_model_of("crossing", pace=paced(save_model_of("crossing")))
    crossing = load_scenario("crossing")
    strategy = load_strategy(str(path), crossing, "soft")
    starts, n_drives = start_distribution(crossing, "train"), 800
    drives = sample_timed_decisions(
        strategy.problem.mdp,
        strategy.policy.probabilities,
        strategy.draws[0],
        starts,
        n_episodes=n_drives,
        n_steps=2000,
        rng=np.random.default_rng(7),
    )
    measured_s = np.sort(np.bincount(drives.episode, drives.dwell_s))
    law = strategy.law_from(starts)
    assert law.quantile_s(0.9) < crossing.episode_timeout_s
    # A law in steps is between two of them what the times are in the middle.
    share = np.searchsorted(measured_s, law.times_s + 0.5 * STEP_S, side="right") / n_drives
    # Dvoretzky-Kiefer-Wolfowitz: exceeded once in 10^6.
    assert np.abs(share - law.cdf).max() < np.sqrt(np.log(2e6) / (2 * n_drives))
    assert law.cdf_draws.shape == (1, len(law.times_s))


def test_patience_and_waits_are_those_of_the_place_and_a_longer_patience_arrives_later(
    save_model_of,
):
    path = str(save_model_of(patience_s=9.0))
    starts, medians = start_distribution(HALLWAY, "train"), []
    for patience_s in (2.0, 4.0, 8.0):
        place = HALLWAY.model_copy(update={"patience_s": patience_s, "wait_s": 0.5})
        strategy = load_strategy(path, place, "optimal")
        stays = require_timed(strategy.problem.mdp.transitions).stay_s.tolist()
        assert stays == [patience_s] * 3 + [0.5]
        medians.append(strategy.law_from(starts).quantile_s(0.5))
    assert medians[0] < medians[1] < medians[2]


def test_paces_hold_on_the_grid_of_the_model_alone(save_model_of):
    own = load_scenario("corridor")
    pace = paced(save_model_of("corridor"))
    path = str(save_model_of("corridor", pace=pace))
    here = load_strategy(path, own, "optimal")
    model = require_timed(here.problem.mdp.transitions)
    neither = ~np.isin(np.arange(len(pace)), here.problem.goal_states)
    found = model.log_pace[model.model_of[:, 1]][neither]
    np.testing.assert_allclose(np.exp(found), np.array(pace)[neither])
    there = load_strategy(path, HALLWAY, "optimal", transfer=True)
    assert not require_timed(there.problem.mdp.transitions).log_pace.any()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"reward_weights": {"goal": 1.0, "noise_level": 2.0}},
            "features must be among goal, social_norm, inverse_wall_distance, got 'noise_level'",
        ),
        (
            {"outcome_names": ("stay", "forward", "right", "back", "spin")},
            "outcome_names must have stay, forward, right, back, left, but 'left' is missing",
        ),
        (
            {"outcome_models": ROWS[1:]},
            "outcome_models must have with_flow, .*, but 'with_flow' is missing",
        ),
        (
            {"outcome_models": tuple(row.model_copy(update={"shape": None}) for row in ROWS)},
            "outcome_models with a shape must have with_flow, against_flow, across_flow, but"
            " 'with_flow' is missing; learn the model again",
        ),
    ],
)
def test_what_cannot_be_used_is_said_with_the_file(changes, sentence, save_model_of):
    path = save_model_of(**changes)
    with pytest.raises(FileError, match=f"{path.name}: .*{sentence}"):
        load_strategy(str(path), HALLWAY, "optimal", transfer=True)


@pytest.fixture
def draws():
    """Of two: one as the model, and one in which everyone stays more often and moves are slow."""
    learned = np.array(list(OUTCOMES.values()))
    slow = 0.7 * learned + 0.3 * np.eye(5)[0]
    means = np.array(list(MEAN_S.values()))
    return ModelDraws(
        reward_weights=((5.0, 1.0, 0.0), (3.0, 0.5, -0.5)),
        learned=np.stack([learned, slow]).tolist(),
        mean_s=np.stack([means, 3.0 * means]).tolist(),
        shape=((4.0, 4.0, 4.0), (2.0, 8.0, 1.0)),
    )


@pytest.mark.parametrize("kind", ["optimal", "soft"])
def test_arrival_is_averaged_over_the_draws_and_its_curve_by_each_is_known(
    kind, draws, save_model_of
):
    found = load_strategy(str(save_model_of(draws=draws)), HALLWAY, kind)
    starts = start_distribution(HALLWAY, "train")
    law = found.law_from(starts)
    one, other = law.cdf_draws
    assert np.allclose(law.cdf, (one + other) / 2)
    assert np.all(other <= one + 1e-7)
    assert np.max(one - other) > 0.2
    np.testing.assert_allclose(found.arrival.cdf @ starts, law.cdf, atol=1e-9)
    alone = load_strategy(str(save_model_of(name="alone.yaml")), HALLWAY, "optimal")
    np.testing.assert_allclose(found.draws[0], alone.draws[0])


def test_the_plan_solves_the_bellman_equation_of_the_mean_of_k(draws, save_model_of):
    """The mean of P_m(k) (1 + mu g / a)^-a over the draws; stays and waits take given times."""
    found = load_strategy(str(save_model_of(draws=draws)), HALLWAY, "optimal")
    problem, gamma = found.problem, found.file.discount
    rate, stays = -np.log(gamma), np.array([*[HALLWAY.patience_s] * 3, HALLWAY.wait_s])
    probability, moves = np.array(draws.learned), problem.outcome_models
    means, shapes = np.array(draws.mean_s), np.array(draws.shape)
    of_law = np.hstack([(1.0 + means * rate / shapes) ** -shapes, np.ones((2, 1))])
    value, weights = found.learned.value, found.file.weights
    residuals = []
    for state in np.setdiff1d(np.arange(problem.grid.n_states), problem.goal_states):
        best = -np.inf
        for action in range(5):
            m = moves.model_of[state, action]
            following = moves.successors[state, action]
            given = gamma ** stays[m]
            factor = np.where((following == state) | (m == 3), given, of_law[:, m, None])
            k = (probability[:, m] * factor).mean(axis=0)
            best = max(best, problem.features[state, action] @ weights + k @ value[following])
        residuals.append(best - value[state])
    np.testing.assert_allclose(residuals, 0.0, atol=1e-6 * np.abs(value).max())


def test_a_plan_by_a_quantile_is_worth_what_the_worse_draw_is_worth(draws, save_model_of):
    """Of two draws one is slower in everything, so the quantile 0.1 is the plan of that one."""
    path = str(save_model_of(draws=draws))
    found = load_strategy(path, HALLWAY, "optimal", plan_quantile=0.1)
    table = require_timed(found.problem.mdp.transitions).local_probabilities(found.draws[1])
    worse = optimal_policy(found.problem, found.file.weights, table)
    np.testing.assert_allclose(found.learned.value, worse.value, rtol=1e-6)
    starts = start_distribution(HALLWAY, "train")
    assert found.law_from(starts).cdf_draws.shape[0] == 2
    with pytest.raises(FileError, match="plan_quantile must be 0 for the policy 'soft'"):
        load_strategy(path, HALLWAY, "soft", plan_quantile=0.1)
    alone = str(save_model_of(name="alone.yaml"))
    with pytest.raises(FileError, match=r"alone.yaml: plan_quantile needs draws .*; learn"):
        load_strategy(alone, HALLWAY, "optimal", plan_quantile=0.1)
