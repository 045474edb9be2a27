"""What follows from draws of a posterior: credible intervals and the policy averaged over them.

    P(a | s, D) = E[ pi_theta(a | s) | D ]

This average predicts the expert's next decision better than the policy of one point, as it admits
what the demonstrations leave open (MacKay, Neural Computation 4, 1992, section 4.2).

Rewards and dynamics can often explain demonstrations in more than one way (section 4.6.1): the
posterior then has several maxima. Each is approximated on its own, and weighs as its evidence:

    P(mode | D) = exp(log evidence of the mode) / sum over modes
"""

from dataclasses import dataclass, fields

import numpy as np
import scipy.special

from serd_core.arrays import FloatArray, IntArray, require_count, require_generator, require_share
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.bayes.laplace import Laplace, laplace_at, log_posterior_of
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import solution_at
from serd_core.posterior.coordinates import Coordinates, LogPosterior
from serd_core.posterior.parameters import Block

#: Draws that a summary takes unless another number is asked for.
N_DRAWS = 40
#: Maxima closer than this, in standard errors of one of them, are the same.
SAME = 0.01


@dataclass(frozen=True, eq=False)
class PosteriorDraws:
    """n draws of what is learned.

    coordinates: (n, d); reward: (n, F) weights; truth: (n, N) parameters of the dynamics;
    outcome_probabilities, believed_outcome_probabilities: (n, M, K), which are discounted where
    moves take time (`SemiMarkovModels`).
    """

    coordinates: FloatArray
    reward: FloatArray
    truth: FloatArray
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray

    def __len__(self) -> int:
        return len(self.reward)

    def select(self, rows: IntArray | slice) -> "PosteriorDraws":
        """The draws of the given rows."""
        return PosteriorDraws(*(getattr(self, each.name)[rows] for each in fields(self)))


@dataclass(frozen=True, eq=False)
class CredibleIntervals:
    """Lowest and highest of each number, first axis: reward (2, F), outcome tables (2, M, K)."""

    reward: FloatArray
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray


def draws_at(problem: Problem, space: Coordinates, coordinates: FloatArray) -> PosteriorDraws:
    """The draws at (n, d) coordinates."""
    at, model = [space.parameters(u) for u in coordinates], problem.mdp.transitions
    truth, belief = (
        np.stack([each.block(block) for each in at]) for block in (Block.TRUTH, Block.BELIEF)
    )
    tables = (model.local_probabilities(each) for each in (truth, belief))
    return PosteriorDraws(coordinates, np.stack([each.reward for each in at]), truth, *tables)


def laplace_draws(found: Laplace, rng: np.random.Generator, n: int = N_DRAWS) -> PosteriorDraws:
    """n draws of the posterior that start at Laplace's approximation (`Laplace.sample`)."""
    require_count("n", n, 2, f"{N_DRAWS}")
    require_generator(rng)
    return draws_at(found.problem, found.coordinates, found.sample(n, rng))


def credible_intervals(draws: PosteriorDraws, mass: float = 0.9) -> CredibleIntervals:
    """Central intervals that hold this share of the draws."""
    require_share("mass", mass, "0.9")
    ends = [(1.0 - mass) / 2.0, (1.0 + mass) / 2.0]
    numbers = [getattr(draws, each.name) for each in fields(CredibleIntervals)]
    return CredibleIntervals(*(np.quantile(values, ends, axis=0) for values in numbers))


def posterior_policy(problem: Problem, draws: PosteriorDraws) -> FloatArray:
    """(S, A) soft policy averaged over the draws, of the problem they are of or of another task."""
    return averaged_policy(problem, draws.reward, draws.believed_outcome_probabilities)


def averaged_policy(
    problem: Problem, reward_weights: FloatArray, outcome_probabilities: FloatArray
) -> FloatArray:
    """(S, A) mean of the soft policies of (n, F) reward weights and (n, M, K) dynamics."""
    total, value = np.zeros(problem.mdp.available.shape), None
    for weights, table in zip(reward_weights, outcome_probabilities, strict=True):
        transitions = transitions_of(problem.mdp.transitions, table)
        solution = solution_at(problem, weights, transitions, initial_value=value)
        total, value = total + solution.policy, solution.value
    return np.asarray(total / len(reward_weights))


@dataclass(frozen=True, eq=False)
class PosteriorModes:
    """Approximations at all maxima found, those of most weight first.

    weights: (k,) that sum to 1; objective: the log posterior; n_starts: searches there were;
    n_failed: those that ended at no maximum.
    """

    approximations: tuple[Laplace, ...]
    weights: FloatArray
    objective: LogPosterior
    n_starts: int
    n_failed: int

    @property
    def log_evidence(self) -> float:
        """log P(D), summed over the maxima."""
        each = [found.log_evidence for found in self.approximations]
        return float(scipy.special.logsumexp(each))

    def draws(self, problem: Problem, rng: np.random.Generator, n: int = N_DRAWS) -> PosteriorDraws:
        """n draws of the mixture."""
        require_count("n", n, 1, f"{N_DRAWS}")
        require_generator(rng)
        counts = rng.multinomial(n, self.weights)
        pairs = zip(self.approximations, counts, strict=True)
        points = np.concatenate([found.sample(int(count), rng) for found, count in pairs])
        return draws_at(problem, self.objective.coordinates, points)


def posterior_modes(
    problem: Problem,
    decisions: Decisions,
    fit: FitResult,
    rng: np.random.Generator,
    n_starts: int = 12,
) -> PosteriorModes:
    """Search from the fit, and from reward weights drawn from its prior; SerdError without one."""
    require_count("n_starts", n_starts, 1, "12")
    require_generator(rng)
    objective = log_posterior_of(problem, decisions, fit)
    first = objective.coordinates.of(fit.parameters)
    n_features = len(problem.feature_names)
    width = 1.0 / np.sqrt(np.diag(objective.prior_information(first))[:n_features])
    found: list[Laplace] = []
    n_failed = 0
    for number in range(n_starts):
        start = first.copy()
        if number:
            start[:n_features] = width * rng.standard_normal(n_features)
        ascended = NewtonAscent().maximise(objective, start)
        if not ascended.converged:
            n_failed += 1
        elif not any(_same(one, ascended.vector) for one in found):
            found.append(laplace_at(objective, ascended.vector))
    if not found:
        raise SerdError(
            f"one of {n_starts} searches must reach a maximum, got none; give stronger priors"
        )
    found.sort(key=lambda one: -one.log_evidence)
    weights = scipy.special.softmax([one.log_evidence for one in found])
    return PosteriorModes(tuple(found), np.asarray(weights), objective, n_starts, n_failed)


def _same(one: Laplace, vector: FloatArray) -> bool:
    away = np.linalg.solve(one.root, vector - one.mode)
    return bool(np.linalg.norm(away) <= SAME)
