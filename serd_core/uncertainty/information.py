"""Information matrices of a fit, by the numbers that were free.

    observed (Hessian):     -d2 J / d theta2                       (with the prior's part)
    outer product (BHHH):   sum over decisions of score score^T    (likelihood only)

The score of a decision is the gradient of log pi(a|s) + log P(s'|s,a), and with a hidden action its
mean over the actions that explain the move. Where moves take time log P(t|s,a,s') is added, and a
decision that a command ended has the survival of its dwell time in place of the last two. Both
matrices estimate the same Fisher information for many decisions under a true model; a large
difference between them is evidence against the model.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, require_kind
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.demonstrations.observations import observe, taken_transitions
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.mdp.problem import Problem, require_problem
from serd_core.posterior.coordinates import free_gauge, free_names, free_scaling
from serd_core.posterior.hessian import (
    Sensitivities,
    choice_scores,
    outcome_scores,
    posterior_hessian,
    sensitivities_at,
    transition_scores,
    vector_hessian,
)
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue, move_scores


def score_sizes(
    posterior: Posterior, parameters: Parameters, q: FloatArray, by_q: FloatArray
) -> FloatArray:
    """(blocks,) largest of the numbers whose differences make a decision's score, by parameter."""
    model, policy_model = posterior.problem.mdp.transitions, posterior.policy_model
    temperature = policy_model.temperature(parameters.policy)
    by_choice = np.abs(by_q).max(axis=(0, 1)) / temperature
    by_outcome = np.abs(model.local_jacobian(parameters.truth)).max(axis=0, initial=0.0)
    largest_q = float(np.abs(q[np.isfinite(q)]).max())
    by_temperature = np.full(len(parameters.policy), largest_q / temperature**2)
    return np.concatenate([by_choice, by_outcome, by_temperature])


@dataclass(frozen=True, eq=False)
class Information:
    """Both information matrices over n free numbers.

    names: (n,); observed, outer_product: (n, n); gradient: (n,) of J there, 0 at an optimum.
    score_sizes: (n,) largest of the numbers whose differences are the scores of one decision.
    n_decisions: how many; converged: whether the fit did, in what is determined.
    gauge: (g, n) directions that change nothing, such as a constant added to all energies of an
    outcome model. parameters: where they were taken; jacobian: (all blocks, n).
    """

    names: tuple[str, ...]
    observed: FloatArray
    outer_product: FloatArray
    gradient: FloatArray
    score_sizes: FloatArray
    n_decisions: float
    converged: bool
    gauge: FloatArray
    parameters: Parameters
    jacobian: FloatArray


def fit_information(
    problem: Problem,
    decisions: Decisions,
    fit: FitResult,
) -> Information:
    """Compute the information matrices of a fit, from which standard errors follow.

    SerdError where the fit is one of another problem, or does not record what it assumed.

        information = sc.fit_information(problem, decisions, fit)
        errors = sc.standard_errors(problem, information)
    """
    require_problem(problem)
    require_fit(fit)
    assumed = fit.assumed
    _require_fitting(problem, fit)
    observations = observe(problem.mdp, decisions)
    whole_prior = assumed.whole_prior.anchored(fit.initial_outcome_probabilities)
    posterior = Posterior(problem, observations, assumed.policy_model, whole_prior)
    at = posterior.evaluate(fit.parameters)
    found = sensitivities_at(posterior, fit.parameters, at)
    hessian = posterior_hessian(posterior, fit.parameters, at, found)
    jacobian = assumed.belief.jacobian(fit.parameters)
    scores = transition_scores(posterior, fit.parameters, at, found)
    hidden, counts = move_scores(at.expected, scores), observations.group_count
    if isinstance(decisions, TimedDecisions):
        scores = _scores_of_timed(posterior, fit.parameters, at, found, decisions)
        counts = np.ones(len(scores))
    free_scores = np.concatenate([scores, hidden]) @ jacobian
    sizes = score_sizes(posterior, fit.parameters, at.solution.q, found.by_q)
    counts = np.concatenate([counts, observations.hidden.count])
    observed = -vector_hessian(assumed.belief, hessian, at.gradient, fit.parameters)
    scaling = free_scaling(posterior, fit.parameters, jacobian)
    return Information(
        names=free_names(problem, fit.parameters, jacobian),
        observed=observed if scaling is None else _flat_along(scaling, observed),
        outer_product=(free_scores * counts[:, None]).T @ free_scores,
        gradient=assumed.belief.pull_back(at.gradient, fit.parameters),
        score_sizes=np.max(np.abs(jacobian) * sizes[:, None], axis=0),
        n_decisions=float(counts.sum()),
        converged=fit.converged or bool(fit.undetermined),
        gauge=free_gauge(problem, fit.parameters, jacobian),
        parameters=fit.parameters,
        jacobian=jacobian,
    )


def require_information(information: object) -> None:
    """SerdError unless an argument is an `Information`."""
    example = "fit_information(problem, decisions, fit)"
    require_kind("information", information, (Information,), example)


def _scores_of_timed(
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    found: Sensitivities,
    decisions: TimedDecisions,
) -> FloatArray:
    """(n, blocks) scores of each decision whose action is known."""
    mdp, dwells = posterior.problem.mdp, posterior.observations.dwells
    truth = parameters.place(Block.TRUTH)
    scores = np.zeros((len(decisions), len(parameters.vector)))
    shown = ~decisions.hidden
    state, action = decisions.state[shown], decisions.action[shown]
    scores[shown] = choice_scores(posterior, parameters, at, found, state, action)
    ended = np.flatnonzero(shown & ~decisions.censored)
    key = taken_transitions(mdp, decisions.select(ended))
    scores[ended, truth] += outcome_scores(mdp.transitions, parameters.truth, key)
    if dwells is not None:
        scores[dwells.row, truth] += dwells.scores(parameters.truth)
    return scores[shown]


def _flat_along(direction: FloatArray, matrix: FloatArray) -> FloatArray:
    """(n, n) the symmetric matrix without what rounding and an inexact maximum leave along one."""
    unit = direction / np.linalg.norm(direction)
    across = np.eye(len(unit)) - np.outer(unit, unit)
    return np.asarray(across @ matrix @ across)


def _require_fitting(problem: Problem, fit: FitResult) -> None:
    at = fit.parameters
    for name, found, wanted in (
        ("reward weights", len(at.reward), len(problem.feature_names)),
        ("dynamics parameters", len(at.truth), problem.mdp.transitions.n_parameters),
    ):
        if found != wanted:
            raise SerdError(
                f"fit must have {wanted} {name} as the problem does, got {found}; pass the problem"
                " it was made with"
            )
