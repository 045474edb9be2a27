"""Standard errors of rewards that were learned under dynamics estimated before, from the same data.

Rewards w under an estimate t of the dynamics solve g(w, t) = 0 with the error of t in it. For the
scores s1 of the transitions, s2 of the choices and the pseudo-counts of the M-estimate, the stacked
conditions have the derivative and covariance

    A = -[ d s1/dt    0     ]      B = sum (s1, s2) (s1, s2)^T,     Cov = A^-1 B A^-T
         [ d s2/dt  d s2/dw ]

(Newey and McFadden, Handbook of Econometrics IV, 1994, section 6; under a true model it is the
estimator of Murphy and Topel, Journal of Business and Economic Statistics 3, 1985). Errors that
take the dynamics as known are too small.
"""

import numpy as np
import scipy.linalg

from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.dynamics.estimation import outcome_models_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.problem import Problem
from serd_core.posterior.beliefs import FixedBelief
from serd_core.posterior.coordinates import gauge_free_basis
from serd_core.posterior.derivatives.posterior_hessian import (
    posterior_hessian,
    sensitivities_at,
    transition_scores,
)
from serd_core.posterior.derivatives.transition_derivatives import log_transition_hessian
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.uncertainty.identifiability import identifiability
from serd_core.uncertainty.information import fit_information
from serd_core.uncertainty.standard_errors import StandardErrors


def two_step_standard_errors(
    problem: Problem, decisions: Decisions, fit: FitResult, *, pseudo_count: float = 1.0
) -> StandardErrors:
    """For a fit by likelihood under the M-estimate of its own decisions.

    pseudo_count: that of the estimate. Where decisions are independent of each other, the errors
    hold where the model is wrong, too (sandwich). SerdError for a fit with a temperature.
    """
    assumed, model = fit.assumptions, outcome_models_of(problem.mdp)
    if assumed is None or not isinstance(assumed.belief, FixedBelief):
        raise SerdError(
            "fit must be one of rewards under an estimate of the dynamics, got one that learned"
            " both at once; use standard_errors"
        )
    if decisions.hidden.any():
        raise SerdError(
            f"decisions must show their actions, got {int(decisions.hidden.sum())} without; use"
            " bootstrap"
        )
    _require_rewards_at_optimum(problem, decisions, fit)
    at, observations = fit.parameters, observe(problem.mdp, decisions)
    posterior = Posterior(problem, observations, assumed.policy_model, assumed.prior)
    value = posterior.evaluate(at)
    found = sensitivities_at(posterior, at, value)
    hessian = posterior_hessian(posterior, at, value, found)
    scores = transition_scores(posterior, at, value, found)
    reward, truth, belief = (at.place(block) for block in (Block.REWARD, Block.TRUTH, Block.BELIEF))
    smoothing = DirichletPrior(pseudo_count).hessian(model, at)[truth, truth]
    own = log_transition_hessian(model, at.truth, observations.counts(model)) + smoothing
    basis = gauge_free_basis(model.gauge)
    n_dynamics, n_rewards = basis.shape[1], len(at.reward)
    slope = np.zeros((n_dynamics + n_rewards,) * 2)
    slope[:n_dynamics, :n_dynamics] = -basis.T @ own @ basis
    slope[n_dynamics:, :n_dynamics] = -hessian[reward, belief] @ basis
    slope[n_dynamics:, n_dynamics:] = -hessian[reward, reward]
    stacked = np.concatenate([scores[:, truth] @ basis, scores[:, reward]], axis=1)
    spread = (stacked * observations.group_count[:, None]).T @ stacked
    try:
        inverse = scipy.linalg.inv(slope)
    except scipy.linalg.LinAlgError as error:
        raise SerdError(
            "decisions must determine the dynamics, got a singular information matrix; pass a"
            f" larger pseudo_count than {pseudo_count}"
        ) from error
    covariance = inverse @ spread @ inverse.T
    jacobian = model.local_jacobian(at.truth) @ basis
    shape = model.local_probabilities(at.truth).shape
    of_dynamics = _errors(jacobian, covariance[:n_dynamics, :n_dynamics]).reshape(shape)
    of_rewards = covariance[n_dynamics:, n_dynamics:]
    errors = np.sqrt(np.diag(of_rewards))
    return StandardErrors(
        names=tuple(f"reward {name}" for name in problem.feature_names),
        free=errors,
        covariance=of_rewards,
        reward=errors,
        outcome_probabilities=of_dynamics,
        believed_outcome_probabilities=of_dynamics,
    )


def _require_rewards_at_optimum(problem: Problem, decisions: Decisions, fit: FitResult) -> None:
    if len(fit.parameters.policy):
        raise SerdError(
            "fit must have no temperature, which two-step errors do not cover, got"
            f" {fit.temperature}; use bootstrap"
        )
    information = fit_information(problem, decisions, fit)
    null = identifiability(information, matrix=information.observed).null
    if null:
        raise SerdError(
            "decisions must determine every reward weight, got a singular information matrix along"
            f" {null[0]}; drop one of these features"
        )
    if not fit.converged:
        raise SerdError(f"fit must have converged, got {fit.message!r}; continue the fit")


def _errors(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(np.sum((jacobian @ covariance) * jacobian, axis=1), 0.0)))
