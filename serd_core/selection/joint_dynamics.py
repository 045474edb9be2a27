"""Whether rewards and dynamics may be learned together, or dynamics are better counted.

SERD takes what the expert believes of the dynamics as true. Where that is wrong, choices bend the
dynamics, and the evidence of both together does not show it: what moves lose is less than what
choices gain. So moves are judged alone, by decisions that were left out,

    held out = sum over left-out moves of log P_joint(s' | s, a) - log P_counted(s' | s, a)

and by predictive checks (Gelman, Meng and Stern 1996) of the counts n of each outcome model, with
those n' of a draw P of the posterior,

    G(n, P) = 2 sum_E n_E log(n_E / (n p_E)),        p-value = P(G(n', P) >= G(n, P) | D)

where E are sets of outcomes with one successor. What actions gain counts for nothing.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import xlogy

from serd_core.arrays import BoolArray, FloatArray, IntArray, floored
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.bayes.laplace import (
    N_CHAINS,
    PosteriorDraws,
    laplace,
    laplace_at,
    laplace_draws,
    log_posterior_of,
)
from serd_core.bayes.strengths import PriorByEvidence, strengths_of
from serd_core.checks import require_generator
from serd_core.demonstrations.decisions import Decisions, reached
from serd_core.demonstrations.observations import taken_transitions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.posterior.coordinates import LogPosterior, coordinates
from serd_core.priors.divergence import require_outcome_models

#: Held-out nats and z-value below which joint dynamics contradict moves; level of predictive tests.
LEAST_NATS, LEAST_Z, LEVEL = -3.0, -1.0, 0.05
#: Nats by which the evidence of joint dynamics must lead for a point estimate to take them.
LEAD = 1.0
#: Counts that are predicted by each draw.
N_REPLICATES = 20
#: Parts of the decisions that are left out in turn.
N_PARTS = 3


@dataclass(frozen=True, eq=False)
class JointDynamics:
    """What speaks for rewards and dynamics that are learned together, against counted dynamics.

    lead_nats: log evidence of the joint fit less that of counts and, given these, choices.
    held_out_nats: log-likelihood of left-out moves, joint less counted; z_value: over its standard
    error. p_values: (M,) predictive, 1 where a model was not observed.
    action_nats, uniform_nats: per left-out action, under counted dynamics and of random choices.
    counted: the fit of rewards under counted dynamics, with a prior by evidence.
    """

    lead_nats: float
    held_out_nats: float
    z_value: float
    p_values: FloatArray
    action_nats: float
    uniform_nats: float
    counted: FitResult

    @cached_property
    def contradicts_moves(self) -> bool:
        """Whether the joint dynamics contradict the moves."""
        by_held_out = self.held_out_nats < LEAST_NATS and self.z_value < LEAST_Z
        n_tests = int(np.sum(self.p_values < 1.0)) or 1
        return by_held_out or float(self.p_values.min()) < LEVEL / n_tests

    @property
    def chosen(self) -> str:
        """`joint`, `counted`, or `neither` where counted dynamics do not explain actions either."""
        if not self.contradicts_moves:
            return "joint"
        return "counted" if self.action_nats > self.uniform_nats else "neither"

    @property
    def point(self) -> str:
        """The dynamics that a point estimate takes; averages take those that are chosen."""
        return "joint" if self.chosen == "joint" and self.lead_nats > LEAD else "counted"

    def sentence(self) -> str:
        """What was found, and what follows, in words."""
        found = (
            f"left-out moves {self.held_out_nats:+.1f} nats (z {self.z_value:+.1f}), least"
            f" predictive p {self.p_values.min():.2g}"
        )
        if self.chosen == "joint":
            lead = f"their evidence leads that of counted ones by {self.lead_nats:+.1f} nats"
            if self.point == "counted":
                lead += ", which is too little for a point estimate: predict by posterior averages"
            return (
                f"dynamics that are learned with the rewards agree with the moves ({found}); {lead}"
            )
        if self.chosen == "counted":
            return (
                f"dynamics that are learned with the rewards contradict the moves ({found}): the"
                " expert does not choose by the true dynamics, so these are counted"
            )
        return (
            f"dynamics that are learned with the rewards contradict the moves ({found}), and under"
            f" counted ones rewards explain actions no better than chance ({self.action_nats:.2f}"
            f" nats per left-out action, random choices {self.uniform_nats:.2f}): no reward is"
            " claimed"
        )


def judge_joint_dynamics(
    problem: Problem, decisions: Decisions, fit: FitResult, rng: np.random.Generator
) -> JointDynamics:
    """Judge the dynamics of a fit by evidence whose belief is the truth.

    SerdError for other beliefs: where these are stated to be apart from the truth, choices may
    contradict moves. It takes three more fits.

        found = sc.judge_joint_dynamics(problem, decisions, fit, np.random.default_rng(0))
        print(found.chosen, found.sentence())
    """
    require_fit(fit)
    require_generator(rng)
    if not isinstance(fit.assumed.belief, TiedBelief) or decisions.hidden.any():
        raise SerdError(
            "fit must have a TiedBelief and decisions with known actions, as other fits do not take"
            f" choices for moves, got {type(fit.assumed.belief).__name__} and"
            f" {int(decisions.hidden.sum())} hidden actions; leave the test out"
        )
    joint = laplace(problem, decisions, fit)
    counted = _counted_fit(problem, decisions, fit)
    of_choices = laplace(problem, decisions, counted).log_evidence - counted.dynamics_log_likelihood
    moves = _moves_alone(problem, decisions, fit)
    gains, parts = np.zeros(len(decisions)), _parts(decisions)
    actions = np.zeros(len(decisions))
    for part in np.unique(parts):
        seen, left_out = decisions.select(parts != part), decisions.select(parts == part)
        gains[parts == part], actions[parts == part] = _left_out(problem, seen, left_out, rng)
    known = reached(decisions)
    by_unit = np.bincount(_units(decisions)[known], weights=gains[known])
    spread = float(np.std(by_unit, ddof=1) * np.sqrt(len(by_unit)))
    n_available = problem.mdp.available.sum(axis=1)[decisions.state]
    draws = laplace_draws(joint, rng, N_CHAINS)
    return JointDynamics(
        lead_nats=joint.log_evidence - moves - of_choices,
        held_out_nats=float(by_unit.sum()),
        z_value=float(by_unit.sum() / max(spread, np.finfo(np.float64).tiny)),
        p_values=predictive_p_values(problem, decisions.select(known), draws, rng),
        action_nats=float(actions.mean()),
        uniform_nats=-float(np.log(n_available).mean()),
        counted=counted,
    )


def _counted_fit(problem: Problem, decisions: Decisions, fit: FitResult) -> FitResult:
    """Rewards under counted dynamics, whose pseudo-count is that of the fit."""
    count = strengths_of(fit.assumed.prior, problem).get("pseudo_count", 1.0)
    dynamics = estimate_dynamics(problem, decisions, count)
    return fit_mdce_irl_by_likelihood(
        problem, decisions, dynamics=dynamics, prior=PriorByEvidence()
    )


def _moves_alone(problem: Problem, decisions: Decisions, fit: FitResult) -> float:
    """Log evidence of the moves without the choices, under the prior of the fit."""
    posterior = log_posterior_of(problem, decisions, fit).posterior
    seen = posterior.observations
    seen = replace(seen, state_action=np.zeros_like(seen.state_action))
    space = coordinates(problem, fit.assumed.belief, fit.parameters)
    objective = LogPosterior(replace(posterior, observations=seen), space)
    found = NewtonAscent().maximise(objective, space.of(fit.parameters))
    return laplace_at(objective, found.vector).log_evidence


def _units(decisions: Decisions) -> IntArray:
    """(N,) number of the episode of each decision; of the decision where there are too few."""
    episodes, number = np.unique(decisions.episode, return_inverse=True)
    return number if len(episodes) >= N_PARTS else np.arange(len(decisions))


def _parts(decisions: Decisions) -> IntArray:
    """(N,) number of the part of each decision, of episodes in a row."""
    units = _units(decisions)
    return np.asarray(units * N_PARTS // (units.max() + 1))


def _left_out(
    problem: Problem, seen: Decisions, left_out: Decisions, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """(n,) log-likelihood of left-out moves, joint less counted, and of actions under counted."""
    fit = fit_mdce_serd(problem, seen)
    counted = _counted_fit(problem, seen, fit)
    moves = require_outcome_models(problem.mdp.transitions, "this test")
    draws = laplace_draws(laplace(problem, seen, fit), rng)
    joint = moves.local_probabilities(draws.truth).mean(axis=0)
    tables = joint, moves.local_probabilities(counted.parameters.truth)
    places = moves.groups.places(taken_transitions(problem.mdp, left_out))
    gains = [
        np.log(moves.groups.probabilities(transitions_of(moves, table).entries)[places])
        for table in tables
    ]
    believed = problem.mdp.transitions.local_probabilities(counted.parameters.belief)
    policy = soft_policy(problem, counted.reward_weights, believed).probabilities
    return gains[0] - gains[1], np.log(floored(policy[left_out.state, left_out.action]))


def predictive_p_values(
    problem: Problem, decisions: Decisions, draws: PosteriorDraws, rng: np.random.Generator
) -> FloatArray:
    """(M,) posterior predictive p-value of the moves of each outcome model, 1 without any."""
    models = require_outcome_models(problem.mdp.transitions, "this test")
    pairs = decisions.state * models.n_actions + decisions.action
    successors = models.successors.reshape(-1, models.n_outcomes)
    # Outcomes with one successor have the number of the first of them.
    first = np.argmax(successors[:, :, None] == successors[:, None, :], axis=2)
    reached = np.argmax(successors[pairs] == decisions.next_state[:, None], axis=1)
    rows = np.column_stack([models.model_of.ravel()[pairs], first[pairs]])
    kinds, kind = np.unique(rows, axis=0, return_inverse=True)
    table = models.local_probabilities(draws.truth)
    seen, again = np.zeros((2, len(draws) * N_REPLICATES, models.n_models))
    observed: BoolArray = np.zeros(models.n_models, dtype=np.bool_)
    for number, (model, *of_outcome) in enumerate(kinds.tolist()):
        sums = np.zeros((models.n_outcomes, models.n_outcomes))
        sums[np.arange(models.n_outcomes), of_outcome] = 1.0
        chances = table[:, model] @ sums
        chances /= chances.sum(axis=1, keepdims=True)
        counts = np.bincount(reached[kind == number], minlength=models.n_outcomes)[None]
        chances = np.repeat(chances, N_REPLICATES, axis=0)
        seen[:, model] += _divergence(counts, chances)
        again[:, model] += _divergence(rng.multinomial(counts.sum(), chances), chances)
        observed[model] = True
    return np.where(observed, np.mean(again >= seen, axis=0), 1.0)


def _divergence(counts: IntArray, chances: FloatArray) -> FloatArray:
    """(n,) G of (n, K) or (1, K) counts under (n, K) chances."""
    total = counts.sum(axis=-1, keepdims=True)
    expected = np.maximum(total * chances, np.finfo(np.float64).tiny)
    return np.asarray(2.0 * np.sum(xlogy(counts, np.maximum(counts, 1) / expected), axis=-1))
