"""A posterior density over rewards and outcome models, and a cheap one close to it.

Both are products of the same transitions and Dirichlet densities with the likelihood L of choices
and the other priors N. In the cheap one the Q-function of L is linear in weights and probabilities,

    Q^(s, a) = Q*(s, a) + dQ/dw (w - w*) + dQ/dP (P - P*)

and log N is quadratic, which the normal densities among priors are anyway. * is the mode.

Points are (n, m) free numbers (`serd_core.posterior.coordinates`) of n chains.
"""

from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.bayes.hyperpriors import Scales
from serd_core.bellman.bellman_solver import BellmanProblem, Newton
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import Transitions
from serd_core.mdp.mdp import Mdp
from serd_core.posterior.coordinates import Coordinates, feature_ranges
from serd_core.posterior.hessian import sensitivities
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import DirichletPrior, pseudo_counts_of, require_outcome_models
from serd_core.priors.prior import GaussianPrior, SumOfPriors, terms_of

#: Values to 1e-8 take a third fewer steps, and change no probability of acceptance by more.
SOLVER = Newton(accuracy=1e-8)
#: Most states of the copies of a problem that are solved together; it saves nothing for more.
STACKED = 10_000


@dataclass(frozen=True, eq=False)
class OutcomeGroup:
    """Outcome models that are learned as one.

    place: of their parameters among the free numbers; laws: part of it for dwell times.
    pseudo_counts: (M, K) c of their prior, 0 where that is no Dirichlet density.
    """

    blocks: tuple[Block, ...]
    place: slice
    laws: slice
    pseudo_counts: FloatArray


@dataclass(frozen=True, eq=False)
class ExactPart:
    """What is exact at n points.

    log_policy: (n, p) of the observed pairs; values: (n, S) V; log_others: (n,) log N.
    """

    log_policy: FloatArray
    values: FloatArray
    log_others: FloatArray

    def replaced(self, rows: BoolArray, other: "ExactPart") -> "ExactPart":
        """The same with some rows (n,) of another."""
        return ExactPart(
            np.where(rows[:, None], other.log_policy, self.log_policy),
            np.where(rows[:, None], other.values, self.values),
            np.where(rows, other.log_others, self.log_others),
        )


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Both densities.

    posterior: its prior is N; groups: all but that of the rewards. mode: (m,); gradient, hessian:
    (m,) and (m, m) of log N there; value: (S,) V*. copies: of the MDP, which are solved together.
    pairs: (p,) observed s A + a; state: (p,) places of their states among the (v,) observed ones.
    q: (v, A) Q*; slopes: (v, A, l) its derivatives by l numbers, reward weights and believed
    probabilities; centre: (l,) these at the mode. of_prior: (m,) curvature of the whole prior by
    each number; scales: the prior of the weights where that is no part of `posterior`.
    """

    posterior: Posterior
    space: Coordinates
    groups: tuple[OutcomeGroup, ...]
    mode: FloatArray
    gradient: FloatArray
    hessian: FloatArray
    value: FloatArray
    copies: Mdp
    pairs: IntArray
    state: IntArray
    q: FloatArray
    slopes: FloatArray
    centre: FloatArray
    of_prior: FloatArray
    scales: Scales | None

    @property
    def model(self) -> OutcomeModels:
        """The outcome models of the problem."""
        return require_outcome_models(self.posterior.problem.mdp.transitions, "this density")

    def group_of(self, block: Block) -> OutcomeGroup:
        """The group that has a block."""
        return next(group for group in self.groups if block in group.blocks)

    def rows_of(self, group: OutcomeGroup, model: int) -> IntArray:
        """(K,) places of the energies of one outcome model in the free numbers."""
        size = self.model.n_outcomes
        return np.asarray(np.arange(size) + group.place.start + model * size)

    def log_outcomes(self, points: FloatArray, group: OutcomeGroup) -> FloatArray:
        """(n, M, K) log probabilities of the outcomes of a group."""
        energies = self.model.beta * self.model.energies(points[:, group.place])
        return np.asarray(energies - np.logaddexp.reduce(energies, axis=2, keepdims=True))

    def log_policy(self, points: FloatArray) -> FloatArray:
        """(n, p) of the observed pairs by Q^."""
        believed = self._believed(points)
        n_features = len(self.space.like.reward)
        numbers = np.hstack([points[:, :n_features], believed.reshape(len(points), -1)])
        q = self.q + np.tensordot(numbers - self.centre, self.slopes, axes=(1, 2))
        largest = q.max(axis=2)
        value = largest + np.log(np.sum(np.exp(q - largest[..., None]), axis=2))
        action = self.pairs % q.shape[2]
        return np.asarray(q[:, self.state, action] - value[:, self.state])

    def _believed(self, points: FloatArray) -> FloatArray:
        """(n, M, K) local probabilities that the expert believes."""
        model = self.posterior.problem.mdp.transitions
        return model.local_probabilities(points[:, self.group_of(Block.BELIEF).place])

    def log_others(self, points: FloatArray) -> FloatArray:
        """(n,) log N by its second derivatives, less its value at the mode."""
        away = points - self.mode
        found = away @ self.gradient + 0.5 * np.sum((away @ self.hessian) * away, axis=1)
        return np.asarray(found + self._log_weights(points))

    def _log_weights(self, points: FloatArray) -> FloatArray | float:
        """(n,) log density of the weights where their scales are learned."""
        if self.scales is None:
            return 0.0
        return self.scales.log_density(points[:, : len(self.space.like.reward)])

    def exact(self, points: FloatArray, values: FloatArray) -> ExactPart:
        """L and N at every point; values: (n, S) where solving Bellman's equation starts."""
        n, n_copies = len(points), self.copies.n_states // self.posterior.problem.mdp.n_states
        parts = [
            self._solved(points[rows], values[rows])
            # The last part is filled up with the first points.
            for rows in np.arange(-(-n // n_copies) * n_copies).reshape(-1, n_copies) % n
        ]
        log_policy, solved = (np.concatenate(each)[:n] for each in zip(*parts, strict=True))
        belief = self.space.belief
        at = [belief.unpack(point, self.space.like) for point in points]
        prior, dwells = self.posterior.prior, self.posterior.observations.dwells
        model = self.posterior.problem.mdp.transitions
        log_others = prior.values(model, at)
        if dwells is not None:
            log_others += dwells.by_decision(np.stack([each.truth for each in at])).sum(axis=1)
        return ExactPart(log_policy, solved, log_others + self._log_weights(points))

    def _solved(self, points: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(c, p) log policy of the observed pairs and (c, S) values of as many points as copies."""
        believed = self._believed(points)
        weights = points[:, : len(self.space.like.reward)]
        rewards = np.concatenate([self.posterior.features @ each for each in weights])
        table = believed.reshape(-1, self.model.n_outcomes)
        transitions = Transitions(self.copies.transitions, table)
        policy_model = self.posterior.policy_model
        problem = BellmanProblem(policy_model.equation, rewards, transitions, self.copies)
        solution = SOLVER.solve(problem, values.ravel())
        log_policy = policy_model.log_probabilities(self.space.like.policy, solution.q)
        found = log_policy.reshape(len(points), -1)[:, self.pairs]
        return found, solution.value.reshape(values.shape)


def copies_of(mdp: Mdp, n: int) -> Mdp:
    """n copies of an MDP of outcome models as one, each with states and models of its own."""
    model = mdp.transitions
    assert isinstance(model, OutcomeModels)
    number = np.arange(n)[:, None, None]
    once, (n_states, n_actions, size) = model.successors, model.successors.shape
    successors = once + mdp.n_states * number[..., None]
    shape = n * n_states, n_actions, size
    successors = np.broadcast_to(successors.reshape(n * n_states, -1, size), shape)
    model_of = (model.model_of + model.n_models * number).reshape(shape[:2])
    available, n_models = np.tile(model.available, (n, 1)), n * model.n_models
    return Mdp(OutcomeModels(successors, model_of, available, n_models, model.beta), mdp.discount)


def surrogate(
    posterior: Posterior,
    space: Coordinates,
    mode: FloatArray,
    n: int,
    *,
    learned_scales: bool = False,
) -> Surrogate:
    """Both densities of a posterior of outcome models, around (d,) coordinates of its mode.

    learned_scales: whether each weight has a scale of its own, whatever the prior's.
    """
    mdp, at, belief = posterior.problem.mdp, space.parameters(mode), space.belief
    priors = posterior.prior
    replaced = (DirichletPrior, GaussianPrior) if learned_scales else (DirichletPrior,)
    others = [each for each in terms_of(priors) if not isinstance(each, replaced)]
    without = replace(posterior, prior=SumOfPriors(tuple(others)), solver=SOLVER)
    believed, _, solution, _ = without.solved(at)
    by_local = np.eye(believed.local_probabilities.size)
    derivatives = sensitivities(mdp, without.features, believed, solution, by_local)
    seen = posterior.observations
    pairs = np.union1d(seen.key // mdp.n_states, np.flatnonzero(seen.state_action))
    states, state = np.unique(pairs // mdp.n_actions, return_inverse=True)
    jacobian = belief.jacobian(at)
    gradient = without.prior.evaluate(mdp.transitions, at).gradient
    hessian = without.prior.hessian(mdp.transitions, at)
    if seen.dwells is not None:
        gradient += at.zeros().with_block(Block.TRUTH, seen.dwells.evaluate(at.truth)[1])
        hessian += at.placed(Block.TRUTH, seen.dwells.hessian(at.truth))
    models = require_outcome_models(mdp.transitions, "this density")
    n_parts = -(-n // max(1, STACKED // mdp.n_states))
    groups = []
    for blocks, place in belief.places(at):
        if Block.REWARD not in blocks:
            laws = slice(place.start + models.n_energies, place.stop)
            counts = pseudo_counts_of(priors, blocks, models)
            groups.append(OutcomeGroup(blocks, place, laws, counts))
    return Surrogate(
        posterior=without,
        space=space,
        groups=tuple(groups),
        mode=belief.pack(at),
        gradient=belief.pull_back(gradient, at),
        hessian=jacobian.T @ hessian @ jacobian,
        value=solution.value,
        copies=copies_of(mdp, -(-n // n_parts)),
        pairs=pairs,
        state=state,
        q=solution.q[states],
        slopes=derivatives.by_q_of(states),
        centre=np.concatenate([at.reward, believed.local_probabilities.ravel()]),
        of_prior=-np.diag(jacobian.T @ priors.hessian(mdp.transitions, at) @ jacobian),
        scales=Scales(feature_ranges(posterior.problem)) if learned_scales else None,
    )
