"""Laplace's approximation: a normal distribution at the maximum of the posterior, and its evidence.

In the coordinates u of `serd_core.posterior.coordinates`, with J the log posterior, c the log
constants of the priors, and M = -d2J/du2 at the maximum u* (docs/evidence.md derives both):

    u | D  ~  Normal(u*, M^-1)
    log P(D) = J(u*) + c + d/2 log(2 pi) - 1/2 log det M + log |dw/du| + s

Where nothing but counts informs, the posterior of an outcome model is a Dirichlet distribution with
r = N P*, whose integral the approximation misses by Stirling's series,

    s = sum_m [ log B(r) - sum_k (r_k - 1/2) log(r_k / N) - (K - 1)/2 log(2 pi / N) ]

N counts the observations that the covariance C of the model's energies is worth:
(K - 1) / N = beta^2 trace (diag P - P P^T) C. So the evidence of counted transitions is exact.
The policy averaged over draws predicts the expert's next decision better than that of one point
(MacKay, Neural Computation 4, 1992, section 4.2).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.special import gammaln

from serd_core.arrays import FloatArray
from serd_core.bayes.mixing import effective_sizes
from serd_core.bayes.surrogate import surrogate
from serd_core.bayes.sweeps import Chains, can_sweep
from serd_core.checks import require_count, require_generator, require_kind, require_share
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.solved_policy import solution_at
from serd_core.posterior.coordinates import Coordinates, LogPosterior, coordinates
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import Prior, terms_of
from serd_core.semi_markov.dwell_likelihood import DwellPrior
from serd_core.semi_markov.models import has_laws

#: Longest Newton step, in standard errors, of a point around which the approximation holds.
LONGEST_STEP = 0.1
#: Most independent draws that are swept; each costs some solutions of Bellman's equation.
N_CHAINS = 64
#: States of each chain from which intervals are taken, at first and at most.
FIRST_STATES, MOST_STATES = 16, 64
#: Draws that each end of an interval is worth.
EFFECTIVE = 100.0


@dataclass(frozen=True, eq=False)
class Laplace:
    """A normal approximation of the posterior, over (d,) coordinates.

    posterior: what it approximates; mode: (d,) its maximum; root: (d, d), covariance =
    root @ root.T; log_evidence: log P(D). open_strengths: names of strengths of the prior that are
    not given, so that draws are of their posterior too (`serd_core.bayes.hyperpriors`).
    """

    posterior: Posterior
    coordinates: Coordinates
    mode: FloatArray
    root: FloatArray
    log_evidence: float
    open_strengths: tuple[str, ...] = ()

    @property
    def problem(self) -> Problem:
        """The learning problem of the posterior."""
        return self.posterior.problem

    def sample(self, n: int, rng: np.random.Generator) -> FloatArray:
        """(n, d) draws of the posterior.

        Where dynamics are learned, draws of the approximation are swept to the posterior
        (`serd_core.bayes.sweeps`): up to `N_CHAINS` draws are independent, further ones are later
        states of the same chains. Where rewards alone are, draws are normal, in pairs that mirror
        each other.
        """
        if not can_sweep(self.posterior, self.coordinates):
            return self._normal(n, rng)
        n_chains = min(n, N_CHAINS)
        return self.chains(n_chains, rng).states(-(-n // n_chains))[0][:n]

    def chains(self, n: int, rng: np.random.Generator) -> Chains:
        """Start n chains in the posterior, at draws of the approximation."""
        start = self._normal(2 * n, rng)[:n]  # the second half would mirror the first
        scales, counts = (name in self.open_strengths for name in ("deviation", "pseudo_count"))
        near = surrogate(self.posterior, self.coordinates, self.mode, n, learned_scales=scales)
        return Chains(near, self.root, start, rng, learned_counts=counts)

    def _normal(self, n: int, rng: np.random.Generator) -> FloatArray:
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
    """The approximation at a maximum; SerdError naming the direction in which it is none."""
    posterior, space = objective.posterior, objective.coordinates
    value, gradient = objective.evaluate(mode)
    root, log_det = inverse_root(
        -objective.hessian(mode), objective.prior_information(mode), space.describe
    )
    step = float(np.linalg.norm(root.T @ gradient))
    if require_maximum and not step <= LONGEST_STEP:
        raise SerdError(
            f"Laplace's approximation holds at a maximum, where the Newton step is at most"
            f" {LONGEST_STEP} standard errors long, got {step:.3g}; continue the fit"
        )
    parameters, model = space.parameters(mode), posterior.problem.mdp.transitions
    constant = posterior.prior.log_constant(model, parameters)
    half = 0.5 * (len(mode) * np.log(2.0 * np.pi) - log_det)
    evidence = value + constant + float(half) + space.log_volume
    return Laplace(posterior, space, mode, root, evidence + stirling(posterior, space, mode, root))


def laplace(problem: Problem, decisions: Decisions, fit: FitResult) -> Laplace:
    """Approximate the posterior at a fit by a normal distribution (Laplace).

    Returns mode (d,), root (d, d) of the covariance, and log_evidence in nats. SerdError where the
    fit has a prior that is no density, or is no maximum.

        found = sc.laplace(problem, decisions, sc.fit_mdce_serd(problem, decisions))
        print(found.log_evidence, sc.laplace_draws(found, rng, 400))
    """
    objective = log_posterior_of(problem, decisions, fit)
    found = laplace_at(objective, objective.coordinates.of(fit.parameters))
    return replace(found, open_strengths=fit.assumed.open_strengths)


def require_laplace(found: object) -> None:
    """SerdError unless an argument is a `Laplace`."""
    require_kind("found", found, (Laplace,), "laplace(problem, decisions, fit)")


def log_posterior_of(problem: Problem, decisions: Decisions, fit: FitResult) -> LogPosterior:
    """The log posterior that a fit maximised; SerdError where its prior is no density."""
    require_problem(problem)
    require_fit(fit)
    assumed = fit.assumed
    prior, belief = assumed.whole_prior, assumed.belief
    space = coordinates(problem, belief, fit.parameters)
    require_densities(prior, space, timed=has_laws(problem.mdp.transitions))
    observations = observe(problem, decisions)
    posterior = Posterior(problem, observations, assumed.policy_model, prior)
    return LogPosterior(posterior, space)


def stirling(posterior: Posterior, space: Coordinates, mode: FloatArray, root: FloatArray) -> float:
    """What the approximation lacks of the integrals over outcome models."""
    total = 0.0
    for block in _dirichlet_blocks(posterior, space, mode, root):
        by_outcome = _stirling(block.worth[:, None] * block.table)
        total += float(np.sum(by_outcome.sum(axis=1) - _stirling(block.worth)))
    return total


@dataclass(frozen=True, eq=False)
class _DirichletBlock:
    """Outcome models whose posterior is taken as close to Dirichlet distributions.

    place: their rows of the free numbers; table: (M, K) at the mode; worth: (M,) observations N
    that the covariances of their log odds are worth; beta: scale of the energies.
    """

    place: slice
    table: FloatArray
    worth: FloatArray
    beta: float


def _dirichlet_blocks(
    posterior: Posterior, space: Coordinates, mode: FloatArray, root: FloatArray
) -> Iterator[_DirichletBlock]:
    """The blocks of dynamics that are outcome models."""
    model, parameters = posterior.problem.mdp.transitions.moves, space.parameters(mode)
    if not isinstance(model, OutcomeModels) or model.n_outcomes == 1:
        return
    for group, place in space.belief.places(parameters):
        if group == (Block.REWARD,):
            continue
        place = slice(place.start, place.start + model.n_energies)
        spread = model.beta * (space.table[place] @ root)
        spread = spread.reshape(model.n_models, model.n_outcomes, -1)
        table = model.local_probabilities(parameters.block(group[0]))
        centred = spread - np.einsum("mk,mkd->md", table, spread)[:, None]
        worth = (model.n_outcomes - 1) / np.einsum("mk,mkd->m", table, centred**2)
        yield _DirichletBlock(place, table, worth, model.beta)


def _stirling(x: FloatArray) -> FloatArray:
    """log Gamma(x) less its approximation by Stirling's formula."""
    return np.asarray(gammaln(x) - (x - 0.5) * np.log(x) + x - 0.5 * np.log(2.0 * np.pi))


def require_densities(prior: Prior, space: Coordinates, *, timed: bool = False) -> None:
    """SerdError unless the prior is one density over each block that is free."""
    given = prior.blocks
    with_laws = [term.block for term in terms_of(prior) if isinstance(term, DwellPrior)]
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
        if timed and Block.REWARD not in group and not set(group) & set(with_laws):
            raise SerdError(
                f"the prior must be a density over dwell times of the block {names} too, got none;"
                " add a DwellPrior"
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


def inverse_root(
    information: FloatArray, of_prior: FloatArray, describe: Callable[[FloatArray], str]
) -> tuple[FloatArray, float]:
    """Root of the inverse, and log det; SerdError naming a direction that is not positive."""
    size = 1.0 / np.sqrt(np.diag(of_prior))
    factor = np.linalg.cholesky(of_prior * size[:, None] * size) / size[:, None]
    wide = scipy.linalg.solve_triangular(factor, np.eye(len(size)), lower=True).T
    values, vectors = np.linalg.eigh(wide.T @ information @ wide)
    if not values[0] > 0:
        raise SerdError(
            "the log posterior must bend down in every direction at a maximum, but its information"
            f" is {values[0]:.3g} of the prior's along {describe(wide @ vectors[:, 0])};"
            " continue the fit from a point moved along it, or give these numbers a stronger prior"
        )
    bounded = np.maximum(values, 1.0)
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor)))) + float(np.sum(np.log(bounded)))
    # The symmetric root is unique, eigenvectors are not: draws are the same on every machine.
    return wide @ (vectors / np.sqrt(bounded)) @ vectors.T, log_det


#: Draws that a summary takes unless another number is asked for.
N_DRAWS = 40


@dataclass(frozen=True, eq=False)
class PosteriorDraws:
    """n draws of what is learned.

    coordinates: (n, d); reward: (n, F) weights; truth: (n, N) parameters of the dynamics;
    outcome_probabilities, believed_outcome_probabilities: (n, M, K), which are discounted where
    moves take time (`SemiMarkovModels`). n_chains: of which draws are the states, those of a sweep
    in a row. pseudo_counts: (n, M, K) of the prior of true outcomes, as `interval_draws` has them.
    """

    coordinates: FloatArray
    reward: FloatArray
    truth: FloatArray
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray
    n_chains: int
    pseudo_counts: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.reward)

    def interval(self, values: FloatArray, mass: float = 0.9) -> FloatArray:
        """(3, ...) lower end, median and upper end of the central interval of (n, ...) values.

        NaN where the chains did not mix, so that the draws determine no interval.
        """
        require_share("mass", mass, "0.9")
        shares = np.array([(1.0 - mass) / 2.0, 0.5, (1.0 + mass) / 2.0])
        worth = effective_sizes(values, self.n_chains, shares)
        return np.where(worth >= EFFECTIVE, np.quantile(values, shares, axis=0), np.nan)


def draws_at(
    problem: Problem, space: Coordinates, coordinates: FloatArray, n_chains: int | None = None
) -> PosteriorDraws:
    """The draws at (n, d) coordinates, independent ones unless a number of chains is given."""
    at, model = [space.parameters(u) for u in coordinates], problem.mdp.transitions
    truth, belief = (
        np.stack([each.block(block) for each in at]) for block in (Block.TRUTH, Block.BELIEF)
    )
    return PosteriorDraws(
        coordinates=coordinates,
        reward=np.stack([each.reward for each in at]),
        truth=truth,
        outcome_probabilities=model.local_probabilities(truth),
        believed_outcome_probabilities=model.local_probabilities(belief),
        n_chains=n_chains or len(coordinates),
    )


def laplace_draws(found: Laplace, rng: np.random.Generator, n: int = N_DRAWS) -> PosteriorDraws:
    """Draw n times from the posterior around the maximum that `laplace` found.

    Returns reward (n, F), outcome_probabilities (n, M, K) and others. Up to 64 draws are
    independent; where dynamics are learned, further ones are later states of the same chains.

        draws = sc.laplace_draws(sc.laplace(problem, decisions, fit), rng, 100)
    """
    require_count("n", n, 2, f"{N_DRAWS}")
    require_generator(rng)
    swept = can_sweep(found.posterior, found.coordinates)
    n_chains = min(n, N_CHAINS) if swept else n
    n_whole = -(-n // n_chains) * n_chains
    points = found.sample(n_whole, rng)[:n]
    return draws_at(found.problem, found.coordinates, points, n_chains)


def interval_draws(found: Laplace, rng: np.random.Generator, mass: float = 0.9) -> PosteriorDraws:
    """Draw from the posterior until intervals that hold `mass` have mixed, or for so long.

    Weights that few choices bound take more sweeps than averages do. `PosteriorDraws.interval` is
    NaN for what has not mixed within `MOST_STATES` states of each chain.

        draws = sc.interval_draws(sc.laplace(problem, decisions, fit), rng)
        print(draws.interval(draws.reward))
    """
    require_share("mass", mass, "0.9")
    require_generator(rng)
    if not can_sweep(found.posterior, found.coordinates):
        return laplace_draws(found, rng, N_CHAINS * FIRST_STATES)
    chains, table = found.chains(N_CHAINS, rng), found.coordinates.table
    shares = np.array([(1.0 - mass) / 2.0, 0.5, (1.0 + mass) / 2.0])
    chains.states(FIRST_STATES)  # away from the normal draws that they start at
    points, counts = chains.states(FIRST_STATES)
    while len(points) < N_CHAINS * MOST_STATES:
        if np.all(effective_sizes(points @ table.T, N_CHAINS, shares) >= EFFECTIVE):
            break
        later = chains.states(len(points) // N_CHAINS)
        points, counts = (
            np.concatenate(both) for both in zip((points, counts), later, strict=True)
        )
    draws = draws_at(found.problem, found.coordinates, points, N_CHAINS)
    return replace(draws, pseudo_counts=counts)


def posterior_policy(problem: Problem, draws: PosteriorDraws) -> FloatArray:
    """Average the soft policy (S, A) over draws, of the problem they are of or of another task.

    draws: of `laplace_draws`.

        policy = sc.posterior_policy(other_problem, sc.laplace_draws(found, rng))
    """
    return averaged_policy(problem, draws.reward, draws.believed_outcome_probabilities)


def averaged_policy(
    problem: Problem, reward_weights: FloatArray, outcome_probabilities: FloatArray
) -> FloatArray:
    """(S, A) mean of `policies_under`."""
    total = np.zeros(problem.mdp.available.shape)
    for policy in policies_under(problem, reward_weights, outcome_probabilities):
        total = total + policy
    return np.asarray(total / len(reward_weights))


def policies_under(
    problem: Problem, reward_weights: FloatArray, outcome_probabilities: FloatArray
) -> Iterator[FloatArray]:
    """The soft policy (S, A) of each of (n, F) reward weights and (n, M, K) dynamics."""
    value = None
    for weights, table in zip(reward_weights, outcome_probabilities, strict=True):
        transitions = transitions_of(problem.mdp.transitions, table)
        solution = solution_at(problem, weights, transitions, initial_value=value)
        value = solution.value
        yield solution.policy
