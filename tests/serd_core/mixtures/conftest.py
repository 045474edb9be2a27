"""Demonstrations of experts of known types."""

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
    """Factory; experts: per type, each of whom gives so many episodes of 12 decisions.

    beliefs: (9, 5) of each type, by default the truth.
    """

    def make(weights, experts=8, episodes=1, seed=1, side=5, beliefs=()) -> MixedCase:
        problem, truth = gridworld_problem(side, 0.9), gridworld_truth()
        beliefs = beliefs or (truth,) * len(weights)
        rng, parts = np.random.default_rng(seed), []
        for number, each in enumerate(weights):
            found = sampled(
                problem,
                soft_policy(problem, np.array(each), beliefs[number]).probabilities,
                truth,
                experts * episodes,
                12,
                rng,
            )
            parts.append(replace(found, episode=found.episode + number * experts * episodes))
        columns = {
            name: np.concatenate([part.columns()[name] for part in parts])
            for name in parts[0].columns()
        }
        decisions = Decisions(**columns)
        types = np.repeat(np.arange(len(weights)), experts * episodes)
        return MixedCase(
            problem, np.array(weights), decisions, types, decisions.episode // episodes
        )

    return make


@pytest.fixture(scope="session")
def mixed(make_mixed) -> MixedCase:
    """Two types, to the light and to the dark, with the same goal."""
    return make_mixed([(3.0, 3.0), (-3.0, 3.0)])
