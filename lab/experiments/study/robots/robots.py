"""The robots: what each has learned from the same demonstrations, and how it chooses.

serd      SERD with its default prior by evidence
irl       rewards by likelihood under counted dynamics and laws of dwell times, with the prior on
          dynamics that SERD found
shortest  no model: the way of the fewest cells, every move believed to succeed, ties at random
goal      the local planner that is given the goal itself

Rewards are of the goal. The robots with `_norm` have the social norm as a feature, too, which says
which way people walk.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.recordings.drives import drive_in
from lab.experiments.study.robots.settings import TASKS, RobotName, RobotsStudy
from serd_app.learning.recipe import LearningTask, dynamics_of, learn, task_in
from serd_app.learning.settings import LearningSettings
from serd_core.arrays import FloatArray
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.demonstrations.observations import observe
from serd_core.dynamics.estimation import most_likely_dynamics
from serd_core.grid.navigation import GOAL, MODEL_NAMES, SOCIAL_NORM, with_dwell_times
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.policies.solved_policy import optimal_policy
from serd_core.priors.divergence import DirichletPrior
from serd_core.priors.prior import terms_of
from serd_core.semi_markov.dwell_likelihood import counted_parameters
from serd_core.semi_markov.models import require_timed
from serd_files.model_file import ModelFile, model_of_fit
from serd_sim.drivers.catalogue import make_driver
from serd_sim.drivers.strategy import load_strategy, start_distribution
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import Scenario

DRIVER = "varied_expert"
#: Shares of arrivals whose times are predicted.
QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True, eq=False)
class Demonstrated:
    """decisions of the demonstrations of a repetition, in a scenario."""

    scenario: Scenario
    decisions: TimedDecisions
    discount: float


def learn_repetition(study: RobotsStudy, place: str, repetition: int) -> dict[str, Any]:
    """Demonstrate, and make each robot of a place.

    demonstrations: one row; robots: by name the policy (S, A) and a row of what was learned, with
    the predicted seconds of each task; the one with the goal has no policy.
    """
    scenario, settings = study.scenarios[place], study.settings
    seed = study.seed_of(place, repetition)
    drives = drive_in(
        scenario,
        navigation_problem_of(scenario, settings.discount),
        make_driver(DRIVER, scenario, seed),
        seed=seed,
        starts=[(number, TASKS[0]) for number in range(settings.demonstrations)],
    )
    shown = Demonstrated(scenario, drives.decisions, settings.discount)
    models = navigation_problem_of(scenario, settings.discount).outcome_models
    used = models.model_of[shown.decisions.state, shown.decisions.action]
    counts = np.bincount(used, minlength=len(MODEL_NAMES)).tolist()
    mean_s = float(np.mean([record.duration_s for record in drives.records]))
    robots = settings.places[place].robots
    return {
        "demonstrations": dict(zip(MODEL_NAMES, counts, strict=True)) | {"mean_s": mean_s},
        "robots": {name: robot(shown, name) for name in robots},
    }


def robot(shown: Demonstrated, name: RobotName) -> dict[str, Any]:
    """Policy and record of one robot."""
    if name == "goal":
        return {"policy": None, "learned": {}}
    if name == "shortest":
        return {"policy": shortest_way(shown.scenario).tolist(), "learned": {}}
    with_norm = name.endswith("_norm")
    features = (GOAL, SOCIAL_NORM) if with_norm else (GOAL,)
    file = model_of(shown, features, counted=name.startswith("irl"))
    strategy = load_strategy(name, shown.scenario, "optimal", file=file)
    learned: Row = dict(zip(file.feature_names, file.weights.tolist(), strict=True))
    for each in file.outcome_models:
        learned[f"forward {each.name}"] = float(np.array(each.learned)[1])
        learned[f"seconds {each.name}"] = each.mean_s
    for task in TASKS:
        law = strategy.law_from(start_distribution(shown.scenario, task))
        for share in QUANTILES:
            learned[f"{task} {share:g}"] = law.quantile_s(share)
    return {"policy": strategy.policy.probabilities.tolist(), "learned": learned}


def model_of(shown: Demonstrated, features: tuple[str, ...], *, counted: bool) -> ModelFile:
    """What `serd learn` writes; counted: of rewards under counted dynamics with the same prior."""
    task = task_with(shown, features)
    found = learn(task, shown.decisions, LearningSettings(discount=shown.discount))
    terms = terms_of(found.fit.assumed.prior)
    priors = [term for term in terms if isinstance(term, DirichletPrior)]
    if not counted or not priors:  # SERD itself counts where choices contradict the moves
        return found.model
    fit = fit_counted(task, shown.decisions, priors[0])
    dynamics, _ = dynamics_of(task.problem, shown.decisions, fit, None)
    return model_of_fit(
        fit,
        task.problem,
        scenario=task.scenario,
        method="mdce_irl",
        prior="that of SERD",
        n_episodes=len(shown.decisions.episodes),
        dynamics=dynamics,
    )


def task_with(shown: Demonstrated, features: tuple[str, ...]) -> LearningTask:
    """The learning task of `serd learn` with some of the features."""
    place = shown.scenario
    problem = navigation_problem_of(place, shown.discount, features)
    timed = with_dwell_times(problem, patience_s=place.patience_s, wait_s=place.wait_s)
    return replace(task_in(place, shown.discount), problem=timed)


def fit_counted(task: LearningTask, decisions: TimedDecisions, prior: DirichletPrior) -> FitResult:
    """IRL by likelihood under the dynamics that moves and dwell times alone make most likely."""
    model, seen = require_timed(task.problem.mdp.transitions), observe(task.problem, decisions)
    outcomes = most_likely_dynamics(model.outcomes, seen, prior.counts(model.outcomes))
    dynamics = counted_parameters(model, outcomes.probabilities, seen.dwells)
    return fit_mdce_irl_by_likelihood(
        task.problem, decisions, dynamics=dynamics, prior=PriorByEvidence()
    )


def shortest_way(scenario: Scenario) -> FloatArray:
    """(S, A) policy that takes the fewest cells; equally good actions are equally likely."""
    problem = navigation_problem_of(scenario, 0.99, ("goal",))
    models = problem.outcome_models
    sure = np.zeros((models.n_models, models.n_outcomes))
    sure[np.arange(models.n_models), models.intended] = 1.0
    return optimal_policy(problem, np.array([1.0]), sure).probabilities
