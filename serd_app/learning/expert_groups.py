"""Groups of episodes by the type of their expert, and the model that keeps the types."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.errors import AppError
from serd_app.learning.learned_traps import learned_traps
from serd_app.learning.outcome import ExpertGroups, FitOutcome
from serd_app.learning.recipe import LearningTask, learn, require_enough
from serd_app.learning.settings import LearningSettings
from serd_core.arrays import IntArray
from serd_core.bayes.belief_comparison import NAMES, RELATIONS
from serd_core.bayes.draws import N_DRAWS
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.navigation import NavigationProblem
from serd_core.mixtures.expert_types import (
    MOST_TYPES,
    ExpertTypes,
    TypeChoice,
    choose_expert_types,
    fit_expert_types,
)
from serd_core.mixtures.pace import has_enough_times, pace_of_types
from serd_core.posterior.beliefs import Belief, TiedBelief
from storage.model_file import ModelType, model_of_fit

Wanted = int | Literal["auto"]
#: Methods whose evidence compares numbers of types, with the relations of each type's belief to
#: the truth that it compares as well.
METHODS: dict[str, tuple[Belief, ...]] = {
    "mdce_serd_evidence": (TiedBelief(),),
    "mdce_serd_belief_evidence": RELATIONS,
}


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
    there is one type, the model is that of `learn`. The relation of belief and truth is one for all
    types; each has a belief of its own unless it is the truth.
    """
    require_enough(demonstrations, settings)
    if settings.method not in METHODS:
        raise AppError(
            f"--experts needs the method {' or '.join(METHODS)}, whose evidence compares numbers of"
            f" types, got {settings.method}; leave out --method or --experts"
        )
    problem, decisions = task.problem, demonstrations.decisions
    choices = {
        NAMES[type(belief)]: _choice(problem, decisions, wanted, experts, belief)
        for belief in METHODS[settings.method]
    }
    relation = max(choices, key=lambda each: choices[each].chosen.log_evidence)
    found, candidates = choices[relation].chosen, choices[relation].candidates
    if not np.isfinite(found.log_evidence):
        raise AppError(f"{found.n_types} types of experts: {found.message}; ask for fewer types")
    kept = _types_of(found, demonstrations, experts)
    groups = ExpertGroups(found, candidates, kept)
    if found.n_types == 1:
        return replace(learn(task, demonstrations, settings), groups=groups)
    sentence = _compared(relation, choices) if len(choices) > 1 else ""
    return _outcome(task, demonstrations, groups, settings, sentence)


def _choice(
    problem: NavigationProblem,
    decisions: Decisions,
    wanted: Wanted,
    experts: IntArray | None,
    belief: Belief,
) -> TypeChoice:
    if wanted == "auto":
        return choose_expert_types(problem, decisions, experts=experts, belief=belief)
    found = fit_expert_types(problem, decisions, wanted, experts=experts, belief=belief)
    return TypeChoice((found,), minimum_episodes=0.0)


def _compared(relation: str, choices: Mapping[str, TypeChoice]) -> str:
    evidence = ", ".join(
        f"{name}: {each.chosen.log_evidence:.1f} with {each.chosen.n_types}"
        for name, each in choices.items()
    )
    return f"The beliefs of the types are {relation}; log evidence by belief: {evidence}."


def _outcome(
    task: LearningTask,
    demonstrations: Demonstrations,
    groups: ExpertGroups,
    settings: LearningSettings,
    belief: str,
) -> FitOutcome:
    found = groups.types
    fit = found.fit()
    drawn = found.draws(np.random.default_rng(settings.seed), N_DRAWS)
    kept = tuple(
        each.model_copy(update={"drawn_weights": tuple(map(tuple, draws.reward.tolist()))})
        for each, draws in zip(groups.kept, drawn, strict=True)
    )
    model = model_of_fit(
        fit,
        task.problem,
        scenario=task.scenario,
        method=settings.method,
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
        learned_traps(task.problem, demonstrations.decisions, fit),
        scenario_yaml=task.scenario_yaml,
        groups=replace(groups, kept=kept),
        belief=belief,
    )


def _types_of(
    found: ExpertTypes, demonstrations: Demonstrations, experts: IntArray | None
) -> tuple[ModelType, ...]:
    """What a model file keeps of each type, without draws."""
    decisions = demonstrations.decisions
    labels = decisions.episode if experts is None else experts
    type_of = found.type_of_unit[np.searchsorted(found.units, labels)]
    names = found.objective.problem.feature_names
    tied = isinstance(found.objective.space.belief, TiedBelief)
    believed = found.believed_outcome_probabilities.tolist()
    deviations, factors = found.reward_deviations, [None] * found.n_types
    if has_enough_times(decisions):
        factors = pace_of_types(found, decisions, experts).factors.tolist()
    return tuple(
        ModelType(
            share=float(found.shares[number]),
            reward_weights=dict(zip(names, found.reward_weights[number].tolist(), strict=True)),
            reward_deviations=dict(zip(names, deviations[number].tolist(), strict=True)),
            episodes=tuple(np.unique(decisions.episode[type_of == number]).tolist()),
            pace=factors[number],
            believed=() if tied else believed[number],
        )
        for number in range(found.n_types)
    )
