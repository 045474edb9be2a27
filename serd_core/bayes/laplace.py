"""Laplace's approximation: a normal distribution at the maximum of the posterior, and its evidence.

In the coordinates u of `serd_core.posterior.coordinates`, with J the log posterior, c the log
constants of the priors, and M = -d2J/du2 at the maximum u* (docs/evidence.md derives both):

    u | D  ~  Normal(u*, M^-1)
    log P(D) = J(u*) + c + d/2 log(2 pi) - 1/2 log det M + log |dw/du| + s

Over softmax energies the posterior of a distribution is closer to normal than over probabilities
(MacKay, Machine Learning 33, 1998). What is left of the error is large where outcomes are rarely
seen and known where nothing but counts informs: there the posterior is a Dirichlet distribution
with r_k = N P*(k), N = pseudo-counts and observations, and the approximation of its integral is off
by Stirling's series,

    s = sum_m [ log B(r) - sum_k (r_k - 1/2) log(r_k / N) - (K - 1)/2 log(2 pi / N) ]

With this term the evidence of counted transitions is exact, and an outcome model about which
nothing is known adds 0, as it should.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.special import gammaln

from serd_core.arrays import FloatArray, weighted_counts
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.problem import Problem
from serd_core.posterior.coordinates import Coordinates, LogPosterior, coordinates
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import Prior

#: Longest Newton step, in standard errors, of a point around which the approximation holds.
LONGEST_STEP = 0.1


@dataclass(frozen=True, eq=False)
class Laplace:
    """The normal distribution, over (d,) coordinates.

    mode: (d,) the maximum; root: (d, d), covariance = root @ root.T; log_evidence: log P(D).
    """

    problem: Problem
    coordinates: Coordinates
    mode: FloatArray
    root: FloatArray
    log_evidence: float

    def sample(self, n: int, rng: np.random.Generator) -> FloatArray:
        """(n, d) draws, in pairs that mirror each other, so that their mean is the mode."""
        half = rng.standard_normal(((n + 1) // 2, len(self.mode)))
        return np.asarray(self.mode + np.concatenate([half, -half])[:n] @ self.root.T)

    @cached_property
    def covariance(self) -> FloatArray:
        """(m, m) of the free numbers."""
        spread = self.coordinates.table @ self.root
        return np.asarray(spread @ spread.T)


def laplace_at(
    objective: LogPosterior, mode: FloatArray, *, require_maximum: bool = True
) -> Laplace:
    """At a maximum; SerdError naming the direction in which it is none.

    require_maximum: whether the gradient must be 0, too.
    """
    posterior, space = objective.posterior, objective.coordinates
    value, gradient = objective.evaluate(mode)
    root, log_det = _root(-objective.hessian(mode), space)
    step = float(np.linalg.norm(root.T @ gradient))
    if require_maximum and not step <= LONGEST_STEP:
        raise SerdError(
            f"Laplace's approximation holds at a maximum, where the Newton step is at most"
            f" {LONGEST_STEP} standard errors long, got {step:.3g}; continue the fit"
        )
    parameters, problem = space.parameters(mode), posterior.problem
    constant = posterior.prior.log_constant(problem.mdp.transitions, parameters)
    half = 0.5 * (len(mode) * np.log(2.0 * np.pi) - log_det)
    evidence = value + constant + float(half) + space.log_volume
    return Laplace(problem, space, mode, root, evidence + stirling(posterior, space, parameters))


def laplace(problem: Problem, decisions: Decisions, fit: FitResult) -> Laplace:
    """At a fit whose prior is a density; SerdError where it is none, or no maximum."""
    objective = log_posterior_of(problem, decisions, fit)
    return laplace_at(objective, objective.coordinates.of(fit.parameters))


def log_posterior_of(problem: Problem, decisions: Decisions, fit: FitResult) -> LogPosterior:
    """The log posterior that a fit maximised; SerdError where its prior is no density."""
    if fit.assumptions is None:
        raise SerdError("the fit must record what it assumed, got none; fit again")
    prior, belief = fit.assumptions.whole_prior, fit.assumptions.belief
    space = coordinates(problem, belief, fit.parameters)
    require_densities(prior, space)
    observations = observe(problem.mdp, decisions)
    posterior = Posterior(problem, observations, fit.assumptions.policy_model, prior)
    return LogPosterior(posterior, space)


def stirling(posterior: Posterior, space: Coordinates, parameters: Parameters) -> float:
    """What the approximation lacks of the integral over outcome models, were they counted alone."""
    model = posterior.problem.mdp.transitions
    if not isinstance(model, OutcomeModels):
        return 0.0
    total, size = 0.0, model.n_outcomes
    for group in space.belief.groups:
        if not {Block.BELIEF, Block.TRUTH} & set(group):
            continue
        worth = sum(
            (posterior.prior.pseudo_observations(model, parameters, block) for block in group),
            np.zeros(model.n_models),
        )
        if Block.TRUTH in group:
            worth = worth + observations_of_models(posterior, model)
        table = model.local_probabilities(parameters.block(group[0]))
        counts = worth[:, None] * table
        log_beta = gammaln(counts).sum(axis=1) - gammaln(worth)
        peak = np.sum((counts - 0.5) * np.log(table), axis=1)
        width = 0.5 * (size - 1) * np.log(2.0 * np.pi / worth)
        total += float(np.sum(log_beta - peak - width))
    return total


def observations_of_models(posterior: Posterior, model: OutcomeModels) -> FloatArray:
    """(M,) transitions that were observed of each outcome model."""
    seen = posterior.observations
    row = model.groups.row[seen.group]
    return weighted_counts(model.model_of.ravel()[row], seen.group_count, model.n_models)


def require_densities(prior: Prior, space: Coordinates) -> None:
    """SerdError unless the prior is one density over each block that is free."""
    given = prior.blocks
    for group in space.belief.groups:
        found = [block.value for block in given if block in group]
        names = " or ".join(block.value for block in group)
        if not found:
            raise SerdError(
                f"the prior must be a density over the block {names} too, got none; add a"
                " GaussianPrior for rewards, a DirichletPrior for dynamics"
            )
        if len(found) > 1:
            raise SerdError(
                f"the block {names} must have one prior, got {len(found)}, which contradict each"
                " other: their product is not normalised; keep one of them"
            )
    free = {block for group in space.belief.groups for block in group}
    idle = [block.value for block in given if block not in free]
    if idle:
        raise SerdError(
            f"the prior must be one of free blocks, got one of {idle[0]}, which"
            f" {type(space.belief).__name__} does not learn; leave it out"
        )
    if len(space.like.policy):
        raise SerdError(
            "evidence and posteriors are those of MdcePolicy, got a policy model with a"
            " temperature, whose posterior has kinks; use fit_mdce_serd"
        )


def _root(information: FloatArray, space: Coordinates) -> tuple[FloatArray, float]:
    """Root of the inverse, and log det; SerdError naming a direction that is not positive."""
    diagonal = np.diag(information)
    if np.all(diagonal > 0):
        scale = 1.0 / np.sqrt(diagonal)
        try:
            factor = np.linalg.cholesky(information * scale[:, None] * scale)
        except np.linalg.LinAlgError:
            pass
        else:
            inverse = scipy.linalg.solve_triangular(factor, np.eye(len(scale)), lower=True)
            log_det = 2.0 * float(np.sum(np.log(np.diag(factor)) - np.log(scale)))
            return scale[:, None] * inverse.T, log_det
    values, vectors = np.linalg.eigh(information)
    raise SerdError(
        "the log posterior must bend down in every direction at a maximum, but its information is"
        f" {values[0]:.3g} along {space.describe(vectors[:, 0])}; continue the fit from a point"
        " moved along it, or give these numbers a stronger prior"
    )
