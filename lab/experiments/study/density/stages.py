"""Stages of the density study: recordings, fits with and without density, measured arrivals.

Each makes one file per number of people and repetition.
"""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from lab.experiments.study.arrival.stage import n_periods
from lab.experiments.study.density.settings import DensityStudy
from lab.experiments.study.products import Stage, load_part, part_tasks
from lab.experiments.study.recordings.drives import drive_in
from lab.experiments.study.study import TRAIN_AREA, TRANSFER_AREA
from serd_app.demonstrations.measured_density import MeasuredDensity
from serd_app.navigation.predicted_density import predicted_density
from serd_app.navigation.strategy import start_distribution
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import arrival_time_distribution
from serd_core.demonstrations.decisions import Decisions, decisions_from_columns
from serd_core.grid.density import at_decisions, in_random_crowds, with_density
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import optimal_policy
from serd_core.selection.evaluation import fitted_policy, move_log_likelihood, policy_log_likelihood
from sim.drivers.catalogue import make_driver
from sim.drivers.policy_driver import PolicyDriver
from storage.yaml_text import write_yaml

#: What is compared.
WITH, WITHOUT = "with density", "without"
_DEMONSTRATED, _DRIVEN = 0, 1
#: Rough seconds of an episode.
_EPISODE_S = 6.0


def stages_of(study: DensityStudy) -> tuple[Stage, ...]:
    """All stages in their order."""
    settings = study.settings
    stages: tuple[tuple[str, Callable[..., Any], tuple[int, ...], float], ...] = (
        ("recordings", record, settings.crowds, _EPISODE_S * settings.demonstrations),
        ("fits", learn, settings.learned_from, 30.0),
        ("arrival", arrive, settings.learned_from, _EPISODE_S * settings.drives),
    )
    described = write_yaml(settings.model_dump(mode="json", exclude={"statistics"}))
    return tuple(
        Stage(
            name,
            study.folder / name,
            described,
            part_tasks(study, name, make, product(crowds, range(settings.repetitions))),
            task_s,
        )
        for name, make, crowds, task_s in stages
    )


def record(study: DensityStudy, people: int, repetition: int) -> dict[str, Any]:
    """Demonstrations from both start areas in turn, with the density at each decision."""
    settings, scenario = study.settings, study.scenario(people)
    learned = people in settings.learned_from
    count = settings.demonstrations if learned else settings.held_out
    seed = study.seed(people, repetition, _DEMONSTRATED)
    found = drive_in(
        scenario,
        study.problem,
        settings.planner,
        make_driver(settings.driver, scenario, seed),
        seed=seed,
        starts=[(episode, (TRAIN_AREA, TRANSFER_AREA)[episode % 2]) for episode in range(count)],
    )
    return {
        "decisions": {name: values.tolist() for name, values in found.decisions.columns().items()},
        "aimed_at_pm2": found.density.aimed_at_pm2.tolist(),
        "mean_pm2": found.density.mean_pm2.tolist(),
        "n_diagonal": found.n_diagonal,
        "n_far": found.n_far,
    }


def recorded(
    study: DensityStudy, people: int, repetition: int
) -> tuple[Decisions, MeasuredDensity]:
    """What `record` wrote."""
    content = load_part(study, "recordings", people, repetition)
    density = MeasuredDensity(np.array(content["aimed_at_pm2"]), np.array(content["mean_pm2"]))
    return decisions_from_columns(content["decisions"]), density


def in_crowd(
    study: DensityStudy, decisions: Decisions, density: MeasuredDensity
) -> tuple[NavigationProblem, Decisions]:
    """Problem and decisions of `at_decisions`, in the crowd that was measured."""
    crowded = with_density(study.problem, density.mean_pm2)
    return at_decisions(crowded, decisions, density.aimed_at_pm2)


def learn(study: DensityStudy, people: int, repetition: int) -> dict[str, Any]:
    """scores: log-likelihoods of held-out demonstrations; predicted: CDFs by whole periods.

    greedy: actions of the model without density, which drive; predictions are for them.
    """
    own = recorded(study, people, repetition)
    plain = fit_mdce_serd(study.problem, own[0])
    problem, decisions = in_crowd(study, *own)
    dense = fit_mdce_serd(problem, decisions)
    settings = study.settings
    truth = plain.outcome_probabilities
    greedy = optimal_policy(study.problem, plain.reward_weights, truth).greedy
    following = (repetition + 1) % settings.repetitions
    scores = []
    for crowd in settings.crowds:
        held_out = recorded(study, crowd, following)
        for name, fit, (at, made) in (
            (WITHOUT, plain, (study.problem, held_out[0])),
            (WITH, dense, in_crowd(study, *held_out)),
        ):
            scores.append({"method": name, "crowd": crowd, **_scores(at, made, fit)})
    return {
        "greedy": greedy.tolist(),
        "scores": scores,
        "converged": [plain.converged, dense.converged],
        "weights": {WITHOUT: plain.reward_weights.tolist(), WITH: dense.reward_weights.tolist()},
        "rows": dense.outcome_probabilities[: len(problem.model_names)].tolist(),
        "predicted": {
            str(crowd): _predicted(study, crowd, greedy, plain, dense) for crowd in settings.crowds
        },
    }


def _scores(problem: NavigationProblem, decisions: Decisions, fit: FitResult) -> dict[str, float]:
    policy = fitted_policy(problem, fit)
    moves = move_log_likelihood(problem, decisions, policy, fit.outcome_probabilities)
    return {
        "action_log_likelihood": policy_log_likelihood(problem, decisions, policy),
        "move_log_likelihood": float(moves.mean()),
        "n_decisions": len(decisions),
    }


def _predicted(
    study: DensityStudy, crowd: int, greedy: IntArray, plain: FitResult, dense: FitResult
) -> dict[str, list[float]]:
    """CDFs of the same actions by either model; density is predicted from the scenario."""
    scenario = study.scenario(crowd)
    crowded = with_density(study.problem, predicted_density(scenario, study.problem.grid))
    cases: dict[str, tuple[NavigationProblem, FloatArray]] = {
        WITHOUT: (study.problem, plain.outcome_probabilities),
        WITH: (crowded, in_random_crowds(dense.outcome_probabilities)),
    }
    policy = np.eye(study.problem.mdp.n_actions)[greedy]
    starts, periods = start_distribution(scenario, TRAIN_AREA), n_periods(scenario)
    return {
        name: arrival_time_distribution(problem, policy, table, starts, periods).cdf.tolist()
        for name, (problem, table) in cases.items()
    }


def arrive(study: DensityStudy, people: int, repetition: int) -> dict[str, list[float]]:
    """Seconds of each episode in each of the other crowds; infinite where it did not arrive."""
    greedy = np.array(load_part(study, "fits", people, repetition)["greedy"])
    policy = np.eye(study.problem.mdp.n_actions)[greedy]
    found = {}
    for crowd in study.settings.predicted:
        seed = study.seed(crowd, repetition, _DRIVEN + study.settings.learned_from.index(people))
        drives = drive_in(
            study.scenario(crowd),
            study.problem,
            study.settings.planner,
            PolicyDriver(study.problem.grid, policy, seed=seed),
            seed=seed,
            starts=[(episode, TRAIN_AREA) for episode in range(study.settings.drives)],
        )
        found[str(crowd)] = [
            record.duration_s if record.outcome == "arrived" else float("inf")
            for record in drives.records
        ]
    return found
