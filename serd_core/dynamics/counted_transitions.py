"""Estimates of sparse transitions by counts: M-estimate under a Dirichlet prior of each pair.

With counts n(s, a, s') and a Dirichlet prior that adds c pseudo-observations to every s' that can
follow a pair (s, a), the estimate maximises over the parameters theta of a SparseModel

    sum_{s,a,s'} (n(s,a,s') + c) log P_theta(s' | s, a)

Where each pair has a distribution of its own over K(s, a) states that is

    P(s' | s, a) = (n(s,a,s') + c) / (n(s,a) + c K(s,a)),

the mean of the Dirichlet posterior, and its mode over log odds (MacKay, Machine Learning 33, 1998).
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, floored, require_positive, weighted_counts
from serd_core.ascent.ascent import Objective
from serd_core.ascent.newton_ascent import NewtonAscent
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import Observations, observe
from serd_core.dynamics.sparse_model import LogOdds, SparseModel, fixed_transitions
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem
from serd_core.posterior.derivatives.transition_derivatives import log_transition_hessian


def counted_transitions(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> TabularProblem:
    """The problem with known transitions: the M-estimate in which each pair has its own counts.

    pseudo_count: c, of each transition that the problem's dynamics can have.
    """
    require_shown(decisions, "the M-estimate of dynamics by counts")
    model = problem.mdp.transitions
    if isinstance(model, SparseModel) and model.n_copies > 1:
        raise SerdError(
            f"problem must have one period to count transitions in, got {model.n_copies}; pass"
            " finite_horizon the counted transitions of the problem itself"
        )
    probability = _counted(model, observe(problem.mdp, decisions), pseudo_count)
    state, action = np.divmod(model.groups.row, model.n_actions)
    known = fixed_transitions(
        model.available.shape, state, action, model.groups.successor, probability
    )
    mdp = Mdp(known, problem.mdp.discount)
    return TabularProblem(mdp, problem.features, problem.feature_names)


def most_likely_parameters(
    model: SparseModel, seen: Observations, pseudo_count: float = 1.0
) -> FloatArray:
    """(n_parameters,) M-estimate, by Newton's method from 0 where it is not one of counts.

    SerdError where 0 gives no distributions, and where the ascent does not converge.
    """
    if isinstance(model.probabilities, LogOdds):
        counted = _counted(model, seen, pseudo_count)[model.groups.group_of_entry]
        return model.probabilities.parameters_of(model.gather(counted))
    require_positive("pseudo_count", pseudo_count)
    start = np.zeros(model.n_parameters)
    model.require_transitions(model.local_probabilities(start))
    counts = seen.counts(model) + pseudo_count / model.n_copies
    found = NewtonAscent().maximise(LogLikelihood(model, counts), start)
    if not found.converged:
        raise SerdError(
            f"the M-estimate of a SparseModel must converge, got {found.message!r} after"
            f" {found.n_steps} steps; pass its parameters as dynamics"
        )
    return found.vector


@dataclass(frozen=True, eq=False)
class LogLikelihood(Objective):
    """sum c_g log P_g over (G,) counts of the distinct transitions, by the parameters."""

    model: TransitionModel
    counts: FloatArray

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """Value and (n_parameters,) gradient."""
        groups, entries = self.model.groups, self.model.local_probabilities(vector)
        probability = floored(groups.probabilities(self.model.entries(entries)))
        slope = (self.counts / probability)[groups.group_of_entry]
        gradient = self.model.pull_back(vector, self.model.gather(slope))
        return float(self.counts @ np.log(probability)), gradient

    def hessian(self, vector: FloatArray) -> FloatArray:
        """(n_parameters, n_parameters) second derivatives."""
        return log_transition_hessian(self.model, vector, self.counts)


def _counted(model: TransitionModel, seen: Observations, pseudo_count: float) -> FloatArray:
    """(G,) estimate of each distinct transition."""
    require_positive("pseudo_count", pseudo_count)
    counts = seen.counts(model) + pseudo_count
    row = model.groups.row
    return np.asarray(counts / weighted_counts(row, counts, model.available.size)[row])
