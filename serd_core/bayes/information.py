"""What is known of each outcome model, and which part of the decisions it comes from.

Information is the Kullback-Leibler divergence from what was known before, in nats (Lindley 1956).
Transitions come first, choices after them:

    from transitions   KLD( p(P_m | transitions) || p(P_m) )                           Dirichlet
    from choices       KLD( p(P_m | transitions and choices) || p(P_m | transitions) )    normal

A reward may explain the same choices as an outcome: I(u_m; w) is what energies and weights share.
What one more demonstration from s0 is expected to add, by the expected Fisher information F(s0)
under the fitted policy, is the D-optimal design of Chaloner and Verdinelli (1995)

    gain(s0) = 1/2 log det(I + L^T F(s0) L),       posterior covariance = L L^T
    F = G + P_pi F,     G(s) = Cov_{a ~ pi(s)} dQ(s, a) + sum_{a, s'} pi(a|s) dP dP^T / P
                               + sum_{a, k} pi(a|s) P_m(k) I_d(m,k)

with I_d the information of a dwell time about its law. docs/information.md has examples.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse
from scipy.special import gammaln, psi

from serd_core.arrays import FloatArray, IntArray, floored, weighted_counts
from serd_core.bayes.hyperpriors import Scales
from serd_core.bayes.laplace import Laplace, PosteriorDraws, interval_draws, require_laplace
from serd_core.bellman.bellman_solver import BellmanSolution
from serd_core.dynamics.estimation import most_likely_dynamics
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import (
    Transitions,
    log_transition_hessian,
    transition_jacobian,
    transitions_at,
)
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import solution_at
from serd_core.posterior.coordinates import feature_ranges, gauge_free_basis
from serd_core.posterior.hessian import sensitivities
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import pseudo_counts_of
from serd_core.semi_markov.gamma_law import fisher_information
from serd_core.semi_markov.models import SemiMarkovModels

#: Information below this is called none.
LEAST_NATS = 0.05
PRIOR_ONLY = "prior only"
#: Visits of later decisions count as none below this share of the demonstrations.
LEFT = 1e-6


@dataclass(frozen=True, eq=False)
class OutcomeInformation:
    """What informed each outcome model: arrays over the M models, in nats unless stated.

    n_decisions: how many were observed; from_transitions, from_choices: information gained.
    shared: with all reward weights; partner: the feature whose weight shares most.
    lower, median, upper: (M, K), of the central intervals that hold `mass` of the posterior; NaN
    where the chains did not mix. weights: (3, F) the same of reward weights.
    from_data: (M, K) nats of the posterior of each probability from its prior without the data of
    its model, both taken as normal. from_choices_of_weights: (F,) the same of each weight.
    draws: of the posterior, from which these are.
    """

    n_decisions: FloatArray
    from_transitions: FloatArray
    from_choices: FloatArray
    shared: FloatArray
    partner: IntArray
    lower: FloatArray
    median: FloatArray
    upper: FloatArray
    mass: float
    weights: FloatArray
    from_data: FloatArray
    from_choices_of_weights: FloatArray
    draws: PosteriorDraws

    def source(self, model: int) -> str:
        """Where what is known of an outcome model comes from."""
        return named_source(counts=self.from_transitions[model], choices=self.from_choices[model])

    def source_of_outcome(self, model: int, outcome: int) -> str:
        """The same of one probability, which the data of its model may leave as it was."""
        informed = self.from_data[model, outcome] >= LEAST_NATS
        return self.source(model) if informed else PRIOR_ONLY

    def source_of_weight(self, feature: int) -> str:
        """Where what is known of a reward weight comes from."""
        return named_source(choices=self.from_choices_of_weights[feature])


def named_source(**nats: float) -> str:
    """Which parts are information, by name."""
    names = [name.replace("_", " ") for name, each in nats.items() if each >= LEAST_NATS]
    return " and ".join(names) or PRIOR_ONLY


def outcome_information(found: Laplace, mass: float = 0.9) -> OutcomeInformation:
    """Compute what informed each outcome model of a fit: moves, choices, or the prior alone.

    found: of `laplace`; mass: of intervals. SerdError where the fit learned no outcome models.

        known = sc.outcome_information(found)
        print([known.source(model) for model in range(n_models)])
    """
    require_laplace(found)
    space, posterior = found.coordinates, found.posterior
    problem, at = found.problem, space.parameters(found.mode)
    models, group = learned_outcomes(found)
    pseudo_counts = pseudo_counts_of(posterior.prior, group, models)
    seen = posterior.observations
    state, action = np.divmod(seen.key // models.n_states, models.n_actions)
    of_model = models.model_of[state, action]
    n_decisions = weighted_counts(of_model, seen.group_count, models.n_models)
    counted, precision = _counted(posterior, models, pseudo_counts)
    joint, n_features = _joint_covariance(found, models), len(problem.feature_names)
    size, rewards = models.n_outcomes - 1, np.arange(n_features)
    away = models.energies(at.truth - counted) @ _contrasts(models).T
    by_choices, shared, partner = [], [], []
    for model in range(models.n_models):
        own = n_features + model * size + np.arange(size)
        by_choices.append(
            _normal_divergence(joint[np.ix_(own, own)], precision[model], away[model])
        )
        shared.append(_mutual_information(joint, own, rewards))
        each = [_mutual_information(joint, own, rewards[[f]]) for f in range(n_features)]
        partner.append(int(np.argmax(each)))
    draws = interval_draws(found, np.random.default_rng(0), mass)
    limits = draws.interval(models.local_probabilities(draws.truth), mass)
    worth = pseudo_counts.sum(axis=1) + n_decisions
    counts = worth[:, None] * models.local_probabilities(counted)
    return OutcomeInformation(
        n_decisions=n_decisions,
        from_transitions=_dirichlet_divergence(counts, pseudo_counts),
        from_choices=np.array(by_choices),
        shared=np.array(shared),
        partner=np.array(partner),
        lower=limits[0],
        median=limits[1],
        upper=limits[2],
        mass=mass,
        weights=draws.interval(draws.reward, mass),
        from_data=_from_data(models, draws),
        from_choices_of_weights=weight_information(found, draws),
        draws=draws,
    )


def _from_data(models: OutcomeModels, draws: PosteriorDraws) -> FloatArray:
    """(M, K) KLD of each probability from that of Dirichlet draws of its pseudo-counts."""
    assert draws.pseudo_counts is not None
    gamma = np.random.default_rng(1).standard_gamma(draws.pseudo_counts)
    before = gamma / floored(gamma.sum(axis=2, keepdims=True))
    return normal_nats(
        models.local_probabilities(draws.truth), before.mean(axis=0), before.var(axis=0)
    )


def normal_nats(draws: FloatArray, mean: FloatArray, variance: FloatArray) -> FloatArray:
    """(...) KLD of the normal distributions of (n, ...) draws from those of a mean and variance."""
    ratio = floored(draws.var(axis=0, ddof=1)) / floored(variance)
    away = (draws.mean(axis=0) - mean) ** 2 / floored(variance)
    return np.asarray(np.maximum(0.5 * (ratio - 1.0 + away - np.log(ratio)), 0.0))


def weight_information(found: Laplace, draws: PosteriorDraws) -> FloatArray:
    """(F,) KLD of the posterior of each weight from its prior, both taken as normal."""
    at = found.coordinates.parameters(found.mode)
    bend = found.posterior.prior.hessian(found.problem.mdp.transitions, at)
    own = at.place(Block.REWARD)
    variance = -1.0 / np.diag(bend)[own]
    if "deviation" in found.open_strengths:
        variance = Scales(feature_ranges(found.problem)).deviations() ** 2
    return normal_nats(draws.reward, np.zeros(len(variance)), variance)


def learned_outcomes(found: Laplace) -> tuple[OutcomeModels, tuple[Block, ...]]:
    """The true outcome models, and the blocks that are them; SerdError where none were learned."""
    models = found.problem.mdp.transitions.moves
    groups = [each for each in found.coordinates.belief.groups if Block.TRUTH in each]
    if not isinstance(models, OutcomeModels) or not groups:
        raise SerdError(
            "the fit must have learned outcome models, got one of rewards only; use fit_mdce_serd"
        )
    return models, groups[0]


def _counted(
    posterior: Posterior, models: OutcomeModels, pseudo_counts: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What transitions alone leave: energies, and (M, K - 1, K - 1) precisions."""
    estimate = most_likely_dynamics(models, posterior.observations, pseudo_counts)
    energies = models.parameters_of(estimate.probabilities)
    counts = posterior.observations.counts(models)
    size = models.n_energies
    totals = np.repeat(pseudo_counts.sum(axis=1), models.n_outcomes)
    bend = models.beta * totals[:, None] * models.local_jacobian(energies)[:, :size]
    bend -= log_transition_hessian(models, energies, counts)[:size, :size]
    shape = (models.n_models, models.n_outcomes) * 2
    own = np.arange(models.n_models)
    blocks = bend.reshape(shape)[own, :, own, :]
    basis = _contrasts(models)
    return energies, basis @ blocks @ basis.T


def _joint_covariance(found: Laplace, models: OutcomeModels) -> FloatArray:
    """Covariance of reward weights, then of the coordinates of each true outcome model."""
    space = found.coordinates
    jacobian = space.belief.jacobian(space.like)
    by_model = np.kron(np.eye(models.n_models), _contrasts(models))
    rows = [jacobian[space.like.place(Block.REWARD)]]
    rows.append(by_model @ jacobian[space.like.place(Block.TRUTH)][: models.n_energies])
    root = np.concatenate(rows) @ space.table @ found.root
    return np.asarray(root @ root.T)


def _contrasts(models: OutcomeModels) -> FloatArray:
    """(K - 1, K) orthonormal rows, orthogonal to 1."""
    size = models.n_outcomes
    return gauge_free_basis(np.full((1, size), size**-0.5)).T


def _normal_divergence(covariance: FloatArray, precision: FloatArray, moved: FloatArray) -> float:
    """KLD of Normal(moved, covariance) from Normal(0, precision^-1)."""
    ratio = precision @ covariance
    _, log_det = np.linalg.slogdet(ratio)
    apart = moved @ precision @ moved
    return max(0.0, float(0.5 * (np.trace(ratio) - len(moved) + apart - log_det)))


def _dirichlet_divergence(counts: FloatArray, pseudo: FloatArray) -> FloatArray:
    """(M,) KLD of Dirichlet(counts) from Dirichlet(pseudo), both (M, K)."""
    total = counts.sum(axis=1)
    log_volumes = gammaln(total) - gammaln(pseudo.sum(axis=1)) + gammaln(pseudo).sum(axis=1)
    moved = np.sum((counts - pseudo) * (psi(counts) - psi(total)[:, None]), axis=1)
    # Of equal distributions, rounding leaves a little above or below 0.
    return np.asarray(np.maximum(log_volumes - gammaln(counts).sum(axis=1) + moved, 0.0))


def _mutual_information(covariance: FloatArray, one: IntArray, other: IntArray) -> float:
    """I = 1/2 log(det S_one det S_other / det S_both) of two parts of normal variables."""
    scale = 1.0 / np.sqrt(np.diag(covariance))
    correlation = covariance * scale[:, None] * scale
    both = np.concatenate([one, other])
    parts = (np.linalg.slogdet(correlation[np.ix_(part, part)])[1] for part in (one, other, both))
    own, others, together = parts
    return float(max(0.0, 0.5 * (own + others - together)))


def expected_information_gain(found: Laplace, *, longest: int = 200) -> FloatArray:
    """Compute the (S,) nats that one more demonstration from each state is expected to add.

    found: of `laplace`; longest: decisions of a demonstration.

        start = sc.expected_information_gain(found).argmax()
    """
    require_laplace(found)
    if longest < 1:
        raise SerdError(f"longest must be at least 1 decision, got {longest}")
    problem, space, model = found.problem, found.coordinates, found.problem.mdp.transitions
    at = space.parameters(found.mode)
    table = space.belief.jacobian(at) @ space.table
    believed = transitions_at(model, at.belief)
    true = transitions_at(model.moves, at.truth)
    solution = solution_at(problem, at.reward, believed)
    policy = solution.policy
    one = _of_choices(problem, at, believed, solution, table)
    one += _of_transitions(true, policy, at, table)
    if isinstance(model, SemiMarkovModels) and model.n_laws:
        one += _of_dwell_times(model, policy, at, table)
    n_states, size = len(one), one.shape[1]
    moved, row = true.entries * policy.ravel()[true.model.row], true.model.row
    places = row // problem.mdp.n_actions, true.model.successor
    going = scipy.sparse.csr_array((moved, places), shape=(n_states, n_states))
    remaining = (~problem.mdp.final).astype(np.float64)
    flat = one.reshape(n_states, -1) * remaining[:, None]
    total, left = flat.copy(), remaining.copy()
    for _ in range(longest - 1):
        left = remaining * (going @ left)
        if np.max(left, initial=0.0) < LEFT:
            break
        total = flat + remaining[:, None] * (going @ total)
    added = found.root.T @ total.reshape(n_states, size, size) @ found.root
    return np.asarray(0.5 * np.linalg.slogdet(np.eye(added.shape[1]) + added)[1])


def _of_choices(
    problem: Problem,
    at: Parameters,
    believed: Transitions,
    solution: BellmanSolution,
    table: FloatArray,
) -> FloatArray:
    """(S, d, d) covariance of the derivatives of Q over the actions of a state."""
    mdp, policy = problem.mdp, solution.policy
    by_local = mdp.transitions.local_jacobian(at.belief)
    by_q = sensitivities(mdp, problem.features, believed, solution, by_local).by_q
    by_u = by_q @ table[: by_q.shape[2]]
    mean = np.einsum("sa,sau->su", policy, by_u)
    root = np.sqrt(policy)[:, :, None] * (by_u - mean[:, None, :])
    return np.asarray(root.transpose(0, 2, 1) @ root)


def _of_transitions(
    true: Transitions, policy: FloatArray, at: Parameters, table: FloatArray
) -> FloatArray:
    """(S, d, d) expected squares of the derivatives of log P(s' | s, a)."""
    model, groups = true.model, true.model.groups
    by_u = transition_jacobian(model, at.truth) @ table[at.place(Block.TRUTH)]
    weights = policy.ravel()[groups.row] / floored(groups.probabilities(true.entries))
    root = np.sqrt(weights)[:, None] * by_u
    state = groups.row // model.n_actions
    total = np.zeros((model.n_states, by_u.shape[1], by_u.shape[1]))
    np.add.at(total, state, root[:, :, None] * root[:, None, :])
    return total


def _of_dwell_times(
    model: SemiMarkovModels, policy: FloatArray, at: Parameters, table: FloatArray
) -> FloatArray:
    """(S, d, d) expected information of the dwell times of a decision about their laws."""
    probability = model.laws(at.truth).probability
    has_law = model.row_law[..., None] == np.arange(model.n_laws)
    expected = np.einsum("rk,rkd->rd", probability, has_law)
    by_state = np.einsum("sa,sad->sd", policy, expected[model.model_of])
    rows, total = table[at.place(Block.TRUTH)], 0.0
    for place, of_law in zip(
        (model.means, model.shapes), fisher_information(at.truth[model.shapes]), strict=True
    ):
        total = total + np.einsum("sd,du,dv->suv", by_state * of_law, rows[place], rows[place])
    return np.asarray(total)
