"""A small L-shaped world with hand-made results: everything a report needs, nothing simulated."""

from pathlib import Path

import numpy as np
import pytest

from serd_app.navigation.comparison import predicted_law
from serd_app.report.inputs import FileLink, Forecast, PhaseTiming, ReportInputs, RunFacts
from serd_app.report.write import write_report
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.grid.navigation import NavigationProblem, with_dwell_times
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import optimal_policy
from serd_core.priors.divergence import KldPrior
from serd_core.semi_markov.models import require_timed
from serd_files.model_file import LearnedDynamics, model_of_fit
from serd_sim.drivers.strategy import Strategy
from serd_sim.scenario.grid import navigation_problem_of, start_states_of
from serd_sim.scenario.scenario import Scenario
from support.episodes import episode_result

#: Of the expert.
WEIGHTS = np.array([5.0, 0.5, 0.1])


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    train, transfer = ([[x, 0], [x + w, 0], [x + w, 1], [x, 1]] for x, w in ((0, 2), (2, 1)))
    ways = [[0.5, 0.5], [2.5, 0.5], [2.5, 4.5], [6.5, 4.5], [6.5, 5.5], [0.5, 5.5]]
    loop = {"name": "round", "waypoints_m": ways, "lane_half_width_m": 0.3}
    return Scenario.model_validate(
        {
            "name": "corner",
            "walkable_area_m": [[0, 0], [3, 0], [3, 4], [7, 4], [7, 6], [0, 6]],
            "goal_area_m": [[6, 4], [7, 4], [7, 6], [6, 6]],
            "start_areas_m": {"train": train, "transfer": transfer},
            "pedestrians": {"count": 3, "loops": [loop]},
        }
    )


@pytest.fixture(scope="session")
def problem(scenario: Scenario) -> NavigationProblem:
    untimed = navigation_problem_of(scenario, 0.95)
    return with_dwell_times(untimed, patience_s=scenario.patience_s, wait_s=scenario.wait_s)


@pytest.fixture(scope="session")
def start(scenario: Scenario, problem: NavigationProblem) -> np.ndarray:
    states = start_states_of(scenario, problem.grid, "train")
    return np.bincount(states, minlength=problem.grid.n_states) / len(states)


@pytest.fixture(scope="session")
def demonstrations(problem: NavigationProblem, start: np.ndarray) -> TimedDecisions:
    outcomes = np.full((4, 5), 0.02)
    outcomes[:, 1] = 0.92
    outcomes[3] = [0.92, 0.02, 0.02, 0.02, 0.02]
    model = require_timed(problem.mdp.transitions)
    truth = model.parameters_from(outcomes, 1.1, 4.0)
    table = model.local_probabilities(truth)
    expert = optimal_policy(problem, WEIGHTS, table)
    return sample_timed_decisions(
        problem.mdp,
        expert.probabilities,
        truth,
        start,
        n_episodes=6,
        n_steps=14,
        rng=np.random.default_rng(5),
        source="hand-made",
    )


@pytest.fixture(scope="session")
def fit(problem: NavigationProblem, demonstrations: TimedDecisions) -> FitResult:
    start = np.array([1.0, 0.1, 0.0])
    return fit_mdce_serd(
        problem.by_decisions, demonstrations, initial_weights=start, prior=KldPrior(0.1)
    )


def strategy_of(
    weights: np.ndarray, scenario: Scenario, problem: NavigationProblem, fit: FitResult
):
    """The optimum of the weights, under the outcomes of the fit and moves of about 2 s."""
    model = require_timed(problem.mdp.transitions)
    truth = model.parameters_from(fit.outcome_probabilities, 2.0, 4.0)
    dynamics = LearnedDynamics(truth, truth, np.zeros(problem.grid.n_states))
    names = {"scenario": scenario.name, "method": "mdce_serd", "prior": "none"}
    file = model_of_fit(fit, problem, n_episodes=6, dynamics=dynamics, **names)
    learned = optimal_policy(problem, weights, model.local_probabilities(truth))
    return Strategy(
        scenario=scenario, problem=problem, learned=learned, file=file, draws=truth[None],
        timeout_s=120.0,
    )  # fmt: skip


@pytest.fixture(scope="session")
def inputs(scenario, problem, demonstrations, fit) -> ReportInputs:
    strategy = strategy_of(WEIGHTS, scenario, problem, fit)
    law = predicted_law(strategy, "train")
    return ReportInputs(
        title="Corner demo",
        strategy=strategy,
        demonstrations=demonstrations,
        demonstration_tracks_m=(np.linspace([0.5, 0.5], [2.5, 5.5], 9),),
        fit=fit,
        episodes=(
            episode_result(0, "arrived", 21.05),
            episode_result(1, "arrived", 24.5, person_on_robot=2),
            episode_result(2, "arrived", 19.0),
            episode_result(3, "timeout", robot_on_person=1),
        ),
        forecasts=tuple(Forecast(f"from place {i}", law) for i in range(3)),
        run=RunFacts(
            command="serd demo --seed 7",
            how="in process",
            finished_at="2026-01-02T03:04:05Z",
            phases=(PhaseTiming("navigate", 2.0, 100.0), PhaseTiming("learn", 0.5)),
            seeds={"world": 7},
            versions={"serd": "0.1.0"},
        ),
        files=(FileLink("model.yaml", "the learned model"),),
    )


@pytest.fixture(scope="session")
def page(inputs: ReportInputs, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole report, its pictures in full size."""
    return write_report(inputs, tmp_path_factory.mktemp("run") / "report").page
