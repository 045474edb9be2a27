"""Whether rewards and dynamics may be learned together, or dynamics are better counted.

SERD takes what the expert believes of the dynamics as true. Where that is wrong, choices bend the
dynamics, and the evidence of both together does not show it: what moves lose is less than what
choices gain. So moves are judged alone, by what choices cost them in nats,

    cost = E[log P(moves | P) | moves] - E[log P(moves | P) | moves, choices]

If the expert believes the truth and the prior is right, the dynamics given moves and choices are,
averaged over choices, distributed as those given the moves alone, and so the cost is 0 on average.
Both expectations are over draws of a posterior, and no fit is repeated without a part of the
decisions. What actions gain counts for nothing.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from serd_core.arrays import FloatArray, floored
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.bayes.laplace import (
    Laplace,
    PosteriorDraws,
    laplace,
    laplace_at,
    laplace_draws,
    require_laplace,
)
from serd_core.bayes.strengths import PriorByEvidence, strengths_of
from serd_core.checks import require_generator
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import Observations
from serd_core.dynamics.estimation import estimate_dynamics, outcome_sets
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.mdp.problem import Problem
from serd_core.posterior.beliefs import TiedBelief
from serd_core.posterior.coordinates import LogPosterior
from serd_core.priors.divergence import require_outcome_models

#: Nats that choices cost the moves above which joint dynamics contradict these. Fixed on the worlds
#: of `lab.posterior.families`, where experts who believe the truth exceed it in 3 of 100 sets.
MOST_COST = 2.3
#: Draws of the dynamics given the moves alone.
N_DRAWS = 64


@dataclass(frozen=True, eq=False)
class JointDynamics:
    """What speaks for rewards and dynamics that are learned together, against counted dynamics.

    cost_nats: of choices to moves; lead_nats: log evidence of the joint fit less that of moves and,
    given counted dynamics, of choices. action_nats, uniform_nats: per action, log evidence of the
    choices under counted dynamics, which is that of each action given those before it, and of
    random choices. counted: the fit of rewards under counted dynamics, and its posterior; that of
    the moves alone, and 64 draws of it.
    """

    cost_nats: float
    lead_nats: float
    action_nats: float
    uniform_nats: float
    counted: FitResult
    posterior_of_counted: Laplace
    posterior_of_moves: Laplace
    moves: PosteriorDraws

    @property
    def chosen(self) -> Literal["joint", "counted", "neither"]:
        """The dynamics to take; `neither` where counted ones do not explain actions either."""
        if self.cost_nats <= MOST_COST:
            return "joint"
        return "counted" if self.action_nats > self.uniform_nats else "neither"

    @cached_property
    def sentence(self) -> str:
        """What was found and what follows, in one sentence."""
        found = (
            f"choices cost the moves {self.cost_nats:.1f} nats of their log-likelihood, where at"
            f" most {MOST_COST:g} are expected of a driver who knows the true dynamics"
        )
        if self.chosen == "joint":
            return f"rewards and dynamics are learned together (joint): {found}"
        if self.chosen == "counted":
            return f"dynamics are counted from the moves alone, as choices contradict them: {found}"
        return (
            f"no reward is claimed, as choices contradict the moves: {found}; and under counted"
            f" dynamics rewards explain actions no better than chance ({self.action_nats:.2f} nats"
            f" per action, random choices {self.uniform_nats:.2f})"
        )


def judge_joint_dynamics(
    found: Laplace,
    decisions: Decisions,
    rng: np.random.Generator,
    draws: PosteriorDraws | None = None,
) -> JointDynamics:
    """Judge the dynamics of a fit whose belief is the truth, by what choices cost its moves.

    found: `laplace` of that fit, by evidence; draws: of it, taken here unless given. SerdError for
    other beliefs: where these are stated to be apart from the truth, choices may contradict moves.
    It takes one fit of rewards.

        posterior = sc.laplace(problem, decisions, fit)
        judged = sc.judge_joint_dynamics(posterior, decisions, np.random.default_rng(0))
        print(judged.chosen, judged.sentence)
    """
    require_laplace(found)
    require_generator(rng)
    problem, belief = found.problem, found.coordinates.belief
    if not isinstance(belief, TiedBelief) or decisions.hidden.any():
        raise SerdError(
            "found must have a TiedBelief and decisions with known actions, as other fits do not"
            f" take choices for moves, got {type(belief).__name__} and"
            f" {int(decisions.hidden.sum())} hidden actions; leave the test out"
        )
    moves = _moves_alone(found)
    drawn = laplace_draws(moves, rng, N_DRAWS)
    draws = laplace_draws(found, rng, N_DRAWS) if draws is None else draws
    seen = moves.posterior.observations
    of_moves, of_both = (_of_moves(problem, seen, each.truth).mean() for each in (drawn, draws))
    count = strengths_of(found.posterior.prior, problem).get("pseudo_count", 1.0)
    counted = fit_under_counts(problem, decisions, count)
    of_counted = laplace(problem, decisions, counted)
    of_choices = of_counted.log_evidence - counted.dynamics_log_likelihood
    n_available = problem.mdp.available.sum(axis=1)[decisions.state]
    return JointDynamics(
        cost_nats=float(of_moves - of_both),
        lead_nats=found.log_evidence - moves.log_evidence - of_choices,
        action_nats=of_choices / len(decisions),
        uniform_nats=-float(np.log(n_available).mean()),
        counted=counted,
        posterior_of_counted=of_counted,
        posterior_of_moves=moves,
        moves=drawn,
    )


def fit_under_counts(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> FitResult:
    """Fit rewards by evidence under counted dynamics: the same prior as SERD's, without the joint.

    pseudo_count: observations that are added to every outcome before they are counted.

        fit = sc.fit_under_counts(problem, decisions)
    """
    dynamics = estimate_dynamics(problem, decisions, pseudo_count)
    return fit_mdce_irl_by_likelihood(
        problem, decisions, dynamics=dynamics, prior=PriorByEvidence()
    )


def _moves_alone(joint: Laplace) -> Laplace:
    """The posterior of the same prior without the choices."""
    seen = joint.posterior.observations
    seen = replace(seen, state_action=np.zeros_like(seen.state_action))
    objective = LogPosterior(replace(joint.posterior, observations=seen), joint.coordinates)
    found = laplace_at(objective, NewtonAscent().maximise(objective, joint.mode).vector)
    return replace(found, open_strengths=joint.open_strengths)


def _of_moves(problem: Problem, seen: Observations, truth: FloatArray) -> FloatArray:
    """(n,) log-likelihood of the moves and dwell times under (n, N) parameters."""
    models = require_outcome_models(problem.mdp.transitions, "this test")
    sets = outcome_sets(models, seen)
    table = models.local_probabilities(truth[:, : models.n_energies])
    found = np.log(floored(np.sum(table[:, sets.model] * sets.explaining, axis=2))) @ sets.count
    if seen.dwells is not None:
        found += seen.dwells.by_decision(truth).sum(axis=1)
    return np.asarray(found)
