"""Demonstrations of experts of two types."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from serd_core.demonstrations.decisions import Decisions
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy
from support.small_problems import gridworld_problem, gridworld_truth, sampled


@dataclass(frozen=True, eq=False)
class MixedCase:
    """types: (E,) true type of each episode; experts: (N,) expert of each decision."""

    problem: TabularProblem
    weights: np.ndarray
    decisions: Decisions
    types: np.ndarray
    experts: np.ndarray


@pytest.fixture(scope="session")
def make_mixed():
    """Factory; experts of each type give episodes of 12 decisions to the light, or to the dark."""

    def make(experts, episodes, side) -> MixedCase:
        problem, truth, n = gridworld_problem(side, 0.9), gridworld_truth(), experts * episodes
        weights, rng, parts = np.array([(3.0, 3.0), (-3.0, 3.0)]), np.random.default_rng(1), []
        for number, own in enumerate(weights):
            policy = soft_policy(problem, own, truth).probabilities
            found = sampled(problem, policy, truth, n, 12, rng)
            parts.append(replace(found, episode=found.episode + number * n).columns())
        columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        decisions = Decisions(**columns)
        types = np.repeat([0, 1], n)
        return MixedCase(problem, weights, decisions, types, decisions.episode // episodes)

    return make
