from pathlib import Path

import pytest

from lab.catalogue import EXPERIMENTS, experiment_named
from lab.experiments.gridworld.ascents import AscentsConfig
from lab.experiments.gridworld.early_stopping import EarlyStoppingConfig
from lab.experiments.gridworld.experiment import GridworldConfig
from lab.experiments.information.avoidance import AvoidanceConfig
from lab.experiments.information.next_demonstration import NextDemonstrationConfig
from lab.experiments.latent.hidden_actions import HiddenActionsConfig
from lab.experiments.minimum_example.explanations import MinimumExampleConfig
from lab.experiments.minimum_example.multi_start import MultiStartConfig
from lab.experiments.policy_cost import PolicyCostConfig
from lab.experiments.priors import PriorsConfig
from lab.experiments.running.experiment import Session
from lab.experiments.rust import RustConfig
from serd_sim.episodes.execution import Execution

DATA = Path(__file__).parents[4] / "shared" / "data" / "rust1987"

SMALL = {
    "minimum-example": MinimumExampleConfig(n_sets=8, sizes=(3,)),
    "avoidance": AvoidanceConfig(n_repetitions=1, sizes=(2,)),
    "hidden-actions": HiddenActionsConfig(n_repetitions=1, sizes=(60,), side=4),
    "next-demonstration": NextDemonstrationConfig(n_repetitions=2, most=2, test_episodes=5),
    "multi-start": MultiStartConfig(n_sets=2, sizes=(3,), n_starts=3),
    "early-stopping": EarlyStoppingConfig(side=5, sizes=(3,), n_steps=8, n_repetitions=1),
    "ascents": AscentsConfig(side=4, n_demonstrations=5, n_steps=8, max_steps=50),
    "priors": PriorsConfig(n_points=9, n_angles=720),
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
    "avoidance": {"posteriors.csv", "summary.csv", "avoidance.png"},
    "hidden-actions": {"estimates.csv", "summary.csv", "hidden_actions.png"},
    "next-demonstration": {"shortfalls.csv", "needed.csv", "next_demonstration.png"},
    "multi-start": {"explanations.csv", "shares.csv", "shares.png", "example.txt"},
    "early-stopping": {"measures.csv", "summary.csv", "measures.png"},
    "ascents": {"costs.csv", "gaps.csv", "gaps.png"},
    "priors": {"optimal_distributions.csv", "surfaces.png"},
    "policy-cost": {"seconds.csv", "exponents.csv", "cost.png"},
    "gridworld": {"summary.csv", "welch_log_likelihood.csv", "measures.png", "transfer.png"},
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


@pytest.mark.skipif(not DATA.is_dir(), reason=f"Rust's bus data are not there; put them in {DATA}")
def test_the_table_of_rust_has_estimates_with_errors(tmp_path):
    session = Session(tmp_path, Execution(n_jobs=1), lambda *_: None)
    table = BY_NAME["rust"].write(RustConfig(data=DATA), session)
    assert list(table["name"][:2]) == ["RC", "theta_11"]
    assert (tmp_path / "estimates.csv").exists()


def test_configurations_are_the_types_the_catalogue_names():
    for experiment in BY_NAME.values():
        if experiment.name in SMALL:
            assert isinstance(SMALL[experiment.name], experiment.config)
