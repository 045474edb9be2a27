"""Drivers by a learned model's file: its optimal policy on the grid of the scenario."""

from serd_core.policies.solved_policy import optimal_policy
from sim.drivers.policy_driver import PolicyDriver
from sim.errors import SimError
from sim.scenario.grid import grid_of, navigation_problem_of
from sim.scenario.scenario import Scenario
from storage.model_file import load_model

MODEL_SUFFIXES = (".yaml", ".yml")


def model_driver(path: str, scenario: Scenario, seed: int) -> PolicyDriver:
    """Drives by the optimal policy of a model; FileError where it is for another grid."""
    grid = grid_of(scenario)
    model = load_model(path, expected_grid=grid)
    flow = model.flow_on(path, grid)
    problem = navigation_problem_of(scenario, model.discount, model.feature_names, flow)
    names = tuple(each.name for each in model.outcome_models)
    if names != tuple(problem.model_names):
        raise SimError(
            f"{path}: outcome_models must be {', '.join(problem.model_names)}, "
            f"got {', '.join(names)}; learn the model again"
        )
    policy = optimal_policy(problem, model.weights, model.outcome_probabilities)
    return PolicyDriver(problem.grid, policy.probabilities, seed=seed, name=path)
