from pathlib import Path

import pytest

from lab.catalogue import EXPERIMENTS, experiment_named
from lab.experiments.durations import DurationsConfig
from lab.experiments.gridworld.ascents import AscentsConfig
from lab.experiments.gridworld.early_stopping import EarlyStoppingConfig
from lab.experiments.gridworld.experiment import GridworldConfig
from lab.experiments.minimum_example.explanations import MinimumExampleConfig
from lab.experiments.minimum_example.multi_start import MultiStartConfig
from lab.experiments.policy_cost import PolicyCostConfig
from lab.experiments.priors import PriorsConfig
from lab.experiments.running.experiment import Session
from serd_sim.episodes.execution import Execution

DATA = Path(__file__).parents[4] / "shared" / "data" / "rust1987"

SMALL = {
    "minimum-example": MinimumExampleConfig(n_sets=8, sizes=(3,)),
    "durations": DurationsConfig(n_repetitions=1, sizes=(3,), draws=4),
    "multi-start": MultiStartConfig(n_sets=2, sizes=(3,), n_starts=3),
    "early-stopping": EarlyStoppingConfig(side=5, sizes=(3,), n_steps=8, n_repetitions=1),
    "ascents": AscentsConfig(side=4, n_demonstrations=5, n_steps=8, max_steps=50),
    "priors": PriorsConfig(n_angles=720),
    "policy-cost": PolicyCostConfig(
        base=(9, 2, 2), n_states=(9, 16), n_actions=(2, 3), n_parameters=(2, 3), repeats=1
    ),
    "gridworld": GridworldConfig(
        side=6, sizes=(4,), n_steps=10, n_test_episodes=10, n_repetitions=2
    ),
}
BY_NAME = {name: experiment_named(name) for name in EXPERIMENTS}
LEFT_BEHIND = {
    "minimum-example": {"estimates.csv", "log_likelihood.csv", "estimates.png"},
    "durations": {"worlds.csv", "summary.csv"},
    "multi-start": {"explanations.csv", "shares.csv"},
    "early-stopping": {"measures.csv", "summary.csv", "measures.png"},
    "ascents": {"costs.csv", "gaps.csv", "gaps.png"},
    "priors": {"optimal_distributions.csv"},
    "policy-cost": {"seconds.csv", "exponents.csv"},
    "gridworld": {"summary.csv", "welch_log_likelihood.csv", "measures.png"},
}


@pytest.mark.parametrize("name", sorted(SMALL))
def test_each_experiment_leaves_its_tables_and_figures(tmp_path, name):
    calls = []
    session = Session(
        tmp_path, Execution(n_jobs=1), lambda done, total: calls.append((done, total))
    )
    summary = BY_NAME[name].write(SMALL[name], session)
    assert len(summary)
    assert LEFT_BEHIND[name] <= {file.name for file in tmp_path.iterdir()}
    assert calls[-1][0] == calls[-1][1]
