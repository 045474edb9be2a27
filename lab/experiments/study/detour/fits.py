"""One repetition of the detour study: learners of growing size, with and without a social norm.

Counted dynamics have their pseudo-count chosen on validation, as MDCE SERD has its lambda.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import rel_entr

from lab.experiments.running.tables import Row
from lab.experiments.study.detour.settings import DetourStudy
from lab.experiments.study.fits.fitting import trials
from lab.experiments.study.fits.methods import (
    Learned,
    Method,
    Trial,
    by,
    irl_with_true_dynamics,
    learned_from_fit,
)
from lab.experiments.study.recordings.demonstrations import load_set
from lab.experiments.study.recordings.reference import reference_dynamics
from serd_app.learning import methods as product
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import AGAINST_FLOW, FEATURE_NAMES, NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.selection.evaluation import (
    policy_log_likelihood,
    select_weight,
    validation_log_likelihood,
)
from serd_sim.scenario.grid import navigation_problem_of

#: The expert of the study: it plans with the measured dynamics.
EXPERT = "knows"
#: Features of the learner's reward.
REWARDS = {
    "goal and wall": tuple(name for name in FEATURE_NAMES if name != "social_norm"),
    "with social norm": FEATURE_NAMES,
}
SERD, COUNTED, INFORMED = "SERD", "IRL, counted dynamics", "IRL, true dynamics"


def learn_repetition(study: DetourStudy, expert: str, repetition: int) -> dict[str, Any]:
    """Learn from every size with every method, and measure; models: one record per fit."""
    training = load_set(study, expert, repetition, "training")
    transfer = load_set(study, expert, repetition, "transfer")
    measures, models, sizes = [], [], study.settings.learning.sizes
    for trial in trials(study, training, sizes, reference_dynamics(study), repetition):
        laws = study.laws_of(trial.decisions).tolist()
        for reward, features in REWARDS.items():
            problem = navigation_problem_of(study.scenario, study.settings.discount, features)
            own = replace(trial, problem=problem)
            for name, method in methods_of(study).items():
                learned = method(own)
                place: Row = {
                    "repetition": repetition,
                    "size": len(trial.decisions.episodes),
                    "reward": reward,
                    "method": name,
                }
                measures.append(place | measured(problem, transfer, trial, learned))
                models.append(place | learned.values() | {"laws": laws})
    return {"measures": measures, "models": models}


def methods_of(study: DetourStudy) -> dict[str, Method]:
    """The learners by name."""
    return {
        SERD: by(product.mdce_serd_evidence),
        COUNTED: counted_irl(study.settings.pseudo_counts),
        INFORMED: irl_with_true_dynamics,
    }


def counted_irl(pseudo_counts: tuple[float, ...]) -> Method:
    """MDCE IRL by likelihood under counts, with the pseudo-count that validation prefers."""

    def learn(trial: Trial) -> Learned:
        def fit(decisions: Decisions, count: float) -> FitResult:
            dynamics = estimate_dynamics(trial.problem, decisions, count)
            return product.fit_rewards(replace(trial, decisions=decisions), dynamics)

        chosen = select_weight(
            lambda count: fit(trial.training, count),
            lambda found: validation_log_likelihood(trial.problem, trial.validation, found),
            pseudo_counts,
        ).weight
        return learned_from_fit(trial.problem, fit(trial.decisions, chosen), chosen)

    return learn


def measured(
    problem: NavigationProblem, transfer: Decisions, trial: Trial, learned: Learned
) -> Row:
    """Likelihood of decisions of the transfer task, and the divergence of each outcome model."""
    models = problem.outcome_models
    used = models.model_of[trial.decisions.state, trial.decisions.action]
    divergences = model_divergences(trial.reference, learned.truth)
    return {
        "against_moves": int(np.sum(used == AGAINST_FLOW)),
        "transfer_log_likelihood": policy_log_likelihood(problem, transfer, learned.policy),
        **{
            f"divergence_{name}": float(value)
            for name, value in zip(problem.model_names, divergences, strict=True)
        },
        "forward_against": float(learned.truth[AGAINST_FLOW, Outcome.FORWARD]),
        "chosen": learned.prior_weight,
        "converged": learned.converged,
    }


def model_divergences(truth: FloatArray, estimate: FloatArray) -> FloatArray:
    """(M,) KLD from the true to the estimated outcomes of each model, all models alike."""
    return np.asarray(np.sum(rel_entr(truth, estimate), axis=1))
