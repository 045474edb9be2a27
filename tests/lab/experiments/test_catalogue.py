import pytest

from lab.catalogue import experiment_named
from lab.experiments.avoidance import AvoidanceConfig
from lab.experiments.durations import DurationsConfig
from lab.experiments.gridworld.ascents import AscentsConfig
from lab.experiments.gridworld.experiment import GridworldConfig
from lab.experiments.minimum_example.explanations import MinimumExampleConfig
from lab.experiments.minimum_example.multi_start import MultiStartConfig
from lab.experiments.policy_cost import PolicyCostConfig
from lab.experiments.priors import PriorsConfig
from lab.experiments.running.experiment import Session
from lab.experiments.standard_errors import StandardErrorsConfig
from serd_sim.episodes.execution import Execution

#: By name a small run, and some of the files that it leaves.
SMALL = {
    "minimum-example": (MinimumExampleConfig(n_sets=8, sizes=(3,)), "log_likelihood.csv"),
    "avoidance": (
        AvoidanceConfig(n_repetitions=2, sizes=(2,), distances=(5,), quantiles=(0.1,), draws=4),
        "worlds.csv summary.csv",
    ),
    "durations": (DurationsConfig(n_repetitions=1, sizes=(3,), draws=4), "worlds.csv summary.csv"),
    "standard-errors": (
        StandardErrorsConfig(n_repetitions=2, sizes=(6,)),
        "estimates.csv summary.csv",
    ),
    "multi-start": (MultiStartConfig(n_sets=2, sizes=(3,), n_starts=3), "shares.csv"),
    "ascents": (
        AscentsConfig(side=4, n_demonstrations=5, n_steps=8, max_steps=50),
        "costs.csv gaps.csv gaps.png",
    ),
    "priors": (PriorsConfig(n_angles=720), "optimal_distributions.csv"),
    "policy-cost": (
        PolicyCostConfig(
            base=(9, 2, 2), n_states=(9, 16), n_actions=(2, 3), n_parameters=(2, 3), repeats=1
        ),
        "seconds.csv exponents.csv",
    ),
    "gridworld": (
        GridworldConfig(side=5, sizes=(3,), n_steps=8, n_test_episodes=8, n_repetitions=2),
        "summary.csv welch_log_likelihood.csv measures.png",
    ),
}


@pytest.mark.parametrize("name", SMALL)
def test_each_experiment_leaves_its_tables_and_figures(tmp_path, name):
    (config, files), calls = SMALL[name], []
    session = Session(tmp_path, Execution(n_jobs=1), lambda *progress: calls.append(progress))
    assert len(experiment_named(name).write(config, session))
    assert set(files.split()) <= {file.name for file in tmp_path.iterdir()}
    assert calls[-1][0] == calls[-1][1]
