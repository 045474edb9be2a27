"""The error of estimated dynamics: KLD(truth || estimate), averaged over visits of the truth.

Transitions are compared, not outcomes, so outcomes that land in the same cell count together. An
estimate that rules out what is true there diverges by inf.
"""

from scipy.special import rel_entr

from serd_core.arrays import FloatArray, weighted_counts
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.problem import Problem


def dynamics_divergence(
    problem: Problem, truth: FloatArray, estimate: FloatArray, visits: FloatArray
) -> float:
    """Mean KLD of estimated transitions from the true ones under visits.

    truth, estimate: (M, K), or (E,) entries; visits: (S, A) counts or shares. Pairs that are never
    visited do not count, were their divergence infinite.
    """
    model = problem.mdp.transitions
    true, other = (
        model.groups.probabilities(transitions_of(model, table).entries)
        for table in (truth, estimate)
    )
    by_row = weighted_counts(model.groups.row, rel_entr(true, other), model.available.size)
    divergence = by_row.reshape(model.available.shape)
    seen = visits > 0
    return float(visits[seen] @ divergence[seen] / visits.sum())
