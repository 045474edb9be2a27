"""Groups of episodes by the type of their expert, and the model that keeps the types."""

from dataclasses import replace
from typing import Literal

import numpy as np

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.errors import AppError
from serd_app.learning.outcome import ExpertGroups, FitOutcome
from serd_app.learning.recipe import LearningTask, learn, require_enough
from serd_app.learning.settings import LearningSettings
from serd_core.arrays import IntArray
from serd_core.bayes.draws import N_DRAWS
from serd_core.dynamics.covariate_models import CovariateModels
from serd_core.mixtures.expert_types import (
    MOST_TYPES,
    ExpertTypes,
    choose_expert_types,
    fit_mixtures,
)
from serd_core.mixtures.pace import has_enough_times, pace_of_types
from storage.model_file import ModelType, model_of_fit

Wanted = int | Literal["auto"]
#: The method whose evidence compares numbers of types.
METHOD = "mdce_serd_evidence"


def wanted_types(text: str) -> Wanted:
    """Number of types of the option `--experts`; AppError where it is neither that nor auto."""
    if text == "auto":
        return "auto"
    if not text.isdecimal() or not 1 <= int(text) <= MOST_TYPES:
        raise AppError(f"--experts must be auto or a number from 1 to {MOST_TYPES}, got {text!r}")
    return int(text)


def learn_groups(
    task: LearningTask,
    demonstrations: Demonstrations,
    settings: LearningSettings,
    wanted: Wanted,
    experts: IntArray | None = None,
) -> FitOutcome:
    """A model of as many types of experts as wanted, or as evidence chooses.

    experts: (N,) number of the expert of each decision, None for each episode by itself. Where
    there is one type, the model is that of `learn`.
    """
    require_enough(demonstrations, settings)
    if settings.method != METHOD:
        raise AppError(
            f"--experts needs the method {METHOD}, whose evidence compares numbers of types, got"
            f" {settings.method}; leave out --method or --experts"
        )
    problem, decisions = task.problem, demonstrations.decisions
    if isinstance(problem.outcome_models, CovariateModels):
        raise AppError(
            "--experts groups episodes under outcomes that do not depend on density, got"
            " --density; leave out one of the two"
        )
    if wanted == "auto":
        choice = choose_expert_types(problem, decisions, experts=experts)
        found, candidates = choice.chosen, choice.candidates
    else:
        found = fit_mixtures(problem, decisions, (wanted,), experts=experts)[0]
        candidates = (found,)
    if not np.isfinite(found.log_evidence):
        raise AppError(f"{found.n_types} types of experts: {found.message}; ask for fewer types")
    groups = ExpertGroups(found, candidates, _types_of(found, demonstrations, experts))
    if found.n_types == 1:
        return replace(learn(task, demonstrations, settings), groups=groups)
    return _outcome(task, demonstrations, groups, settings)


def _outcome(
    task: LearningTask,
    demonstrations: Demonstrations,
    groups: ExpertGroups,
    settings: LearningSettings,
) -> FitOutcome:
    found = groups.types
    fit = found.fit()
    drawn = found.draws(np.random.default_rng(settings.seed), N_DRAWS)
    rows = [each.reward.tolist() for each in drawn]
    kept = [
        each.model_copy(update={"drawn_weights": tuple(map(tuple, weights))})
        for each, weights in zip(groups.kept, rows, strict=True)
    ]
    model = model_of_fit(
        fit,
        task.problem,
        scenario=task.scenario,
        method=METHOD,
        prior=f"by evidence, {found.n_types} types of experts",
        decision_period_s=task.decision_period_s,
        n_episodes=len(demonstrations.decisions.episodes),
        goal_entry_s=demonstrations.goal_entry_s,
        own_flow=task.own_flow,
        draws=drawn[0],
        types=kept,
    )
    return FitOutcome(
        fit,
        model,
        None,
        (),
        scenario_yaml=task.scenario_yaml,
        groups=replace(groups, kept=tuple(kept)),
    )


def _types_of(
    found: ExpertTypes, demonstrations: Demonstrations, experts: IntArray | None
) -> tuple[ModelType, ...]:
    """What a model file keeps of each type, without draws."""
    decisions = demonstrations.decisions
    labels = decisions.episode if experts is None else experts
    type_of = found.type_of_unit[np.searchsorted(found.units, labels)]
    names = found.objective.problem.feature_names
    factors = [None] * found.n_types
    if has_enough_times(decisions):
        factors = pace_of_types(found, decisions, experts).factors.tolist()
    return tuple(
        ModelType(
            share=float(found.shares[number]),
            reward_weights=dict(zip(names, found.reward_weights[number].tolist(), strict=True)),
            reward_deviations=dict(
                zip(names, found.reward_deviations[number].tolist(), strict=True)
            ),
            episodes=tuple(np.unique(decisions.episode[type_of == number]).tolist()),
            pace=factors[number],
        )
        for number in range(found.n_types)
    )
