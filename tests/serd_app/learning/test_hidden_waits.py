"""Waiting where actions are hidden: none of the moves was a wait."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.learning.recipe import learn, task_in
from serd_app.learning.settings import LearningSettings
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.errors import SerdError
from serd_core.grid.grid import Action, Outcome
from serd_core.grid.navigation import WAITING
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.simulation import sample_timed_decisions
from serd_sim.scenario.scenario import load_scenario


def walked(problem, n_episodes):
    """Of an expert whose moves nearly always succeed."""
    models, rng = problem.mdp.transitions, np.random.default_rng(2)
    table = np.array([[0.03, 0.94, 0.01, 0.01, 0.01]] * WAITING + [[0.96, 0.01, 0.01, 0.01, 0.01]])
    truth = models.parameters_from(table, 1.0, 6.0)
    weights = np.array([3.0, 0.3, 0.0])
    policy = soft_policy(problem, weights, models.local_probabilities(truth)).probabilities
    start = np.ones(problem.grid.n_states) / problem.grid.n_states
    return sample_timed_decisions(
        problem.mdp, policy, truth, start, n_episodes=n_episodes, n_steps=60, rng=rng
    )


def test_waits_are_learned_to_stay_and_are_drawn_so():
    task = task_in(load_scenario("corridor"), 0.99)
    shown = walked(task.problem, 8)
    hidden = replace(shown, action=np.full(len(shown), HIDDEN))
    found = learn(task, Demonstrations(hidden), LearningSettings())
    stays = np.eye(len(Outcome))[Outcome.STAY]
    assert found.model.outcome_models[WAITING].learned == tuple(stays)
    for table in found.model.draws.learned:
        assert table[WAITING] == pytest.approx(stays)
    moves = found.fit.outcome_probabilities[:WAITING, Outcome.FORWARD]
    assert moves.max() > 0.8


def test_waiting_leads_nowhere_in_a_problem_with_still_waits():
    problem = task_in(load_scenario("corridor"), 0.99).problem
    still = problem.by_decisions.with_still_waits
    own = np.arange(problem.grid.n_states)[:, None]
    assert (still.outcome_models.successors[:, Action.WAIT] == own).all()
    assert still.mdp.transitions is still.outcome_models
    with pytest.raises(SerdError, match=r"use problem\.by_decisions\.with_still_waits"):
        _ = problem.with_still_waits
