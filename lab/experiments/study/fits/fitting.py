"""One repetition of an expert: all learners on nested random subsets of growing size."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lab.experiments.running.divergence import dynamics_divergence
from lab.experiments.running.tables import Row
from lab.experiments.study.fits.methods import (
    ASSUMPTIONS,
    METHODS,
    PREDICTORS,
    Learned,
    Trial,
    learned_from_fit,
)
from lab.experiments.study.recordings.demonstrations import DemonstrationSets, load_sets
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.recordings.reference import reference_dynamics
from lab.experiments.study.study import Study
from serd_app.learning.methods import fit_tied
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions, state_action_counts
from serd_core.grid.navigation import NavigationProblem
from serd_core.selection.evaluation import policy_log_likelihood, split_episodes


def fit_repetition(study: Study, expert: str, repetition: int) -> dict[str, Any]:
    """Learn from every size with every method, and measure.

    measures, candidates: rows; models: by method, of the largest size, with the laws of dwell times
    that are counted in its demonstrations.
    """
    sets = load_sets(study, expert, repetition)
    reference = reference_dynamics(study)
    chosen = study.settings.learning if expert == PEOPLE else study.settings.beliefs
    methods = METHODS | PREDICTORS if expert == PEOPLE else ASSUMPTIONS
    measures: list[Row] = []
    candidates: list[Row] = []
    models: dict[str, Any] = {}
    for trial in trials(study, sets.training, chosen.sizes, reference, repetition):
        size = len(trial.decisions.episodes)
        place: Row = {"expert": expert, "repetition": repetition, "size": size}
        laws = study.laws_of(trial.decisions).tolist()
        for name, method in methods.items():
            learned = method(trial)
            row = place | {"method": name, "prior_weight": learned.prior_weight}
            measures.append(row | measured(study.problem, sets, reference, learned))
            if size == max(chosen.sizes) and name not in PREDICTORS:
                models[name] = learned.values() | {"laws": laws}
        if expert == PEOPLE:
            candidates += [place | row for row in candidate_rows(trial, sets)]
    return {"measures": measures, "candidates": candidates, "models": models}


def trials(
    study: Study,
    training: Decisions,
    sizes: tuple[int, ...],
    reference: FloatArray,
    repetition: int,
) -> Iterator[Trial]:
    """Each size as a subset of the next, in a random order of the demonstrations."""
    seed, learning = study.settings.seed, study.settings.learning
    shuffled = np.random.default_rng([seed, repetition]).permutation(training.episodes)
    for size in sizes:
        # A generator of its own, so that what learners draw changes no later subset or split.
        rng = np.random.default_rng([seed, repetition, size])
        subset = training.select_episodes(shuffled[:size])
        part, validation = split_episodes(subset, learning.validation_share, rng)
        yield Trial(
            problem=study.problem,
            settings=learning,
            decisions=subset,
            training=part,
            validation=validation,
            rng=rng,
            reference=reference,
        )


def measured(
    problem: NavigationProblem, sets: DemonstrationSets, reference: FloatArray, learned: Learned
) -> Row:
    """Fig. 5.9: likelihood of new decisions, and divergence of the dynamics where experts went."""
    visits = state_action_counts(sets.training, problem.mdp.n_states, problem.mdp.n_actions)
    return {
        "test_log_likelihood": policy_log_likelihood(problem, sets.test, learned.policy),
        "transfer_log_likelihood": policy_log_likelihood(problem, sets.transfer, learned.policy),
        "dynamics_divergence": dynamics_divergence(problem, reference, learned.truth, visits),
        "converged": learned.converged,
    }


def candidate_rows(trial: Trial, sets: DemonstrationSets) -> Iterator[Row]:
    """Fig. 5.8: MDCE SERD with every lambda, learned without the validation episodes."""
    for weight in trial.settings.prior_weights:
        learned = learned_from_fit(trial.problem, fit_tied(trial, trial.training, weight))
        validation = policy_log_likelihood(trial.problem, trial.validation, learned.policy)
        row: Row = {"prior_weight": weight, "validation_log_likelihood": validation}
        yield row | measured(trial.problem, sets, trial.reference, learned)
