"""What learns from the moves of a fold: SERD with hidden actions, IRL, cloning, and dwell times.

IRL takes the displacement of each move as its action and counts the dynamics; SERD hides actions.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lab.experiments.study.people.crowd import bins_of, cells_of_bins
from lab.experiments.study.people.problem import AHEAD, Layers, Moves
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.dwell_times import DwellModel, fit_dwell_times
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import soft_policy

SERD, IRL, CLONING = "SERD", "IRL", "cloning"
#: Probability that no move is less likely than.
FLOOR = 1e-4
#: Kinds of moves by how the cell was entered and is left.
KINDS = ("ahead", "ahead then turned", "turned then ahead", "turned")


@dataclass(frozen=True, eq=False)
class Learned:
    """directions: (S, 4) probability of moving in each direction, for any layers.

    record: numbers that describe the fit.
    """

    directions: Callable[[Layers], FloatArray]
    record: dict[str, object]


def of_fit(fit: FitResult) -> Learned:
    """The law of moves of rewards and outcome models."""

    def directions(layers: Layers) -> FloatArray:
        models = layers.problem.mdp.transitions
        table = models.local_probabilities(fit.parameters.truth)
        policy = soft_policy(layers.problem, fit.reward_weights, table).probabilities
        return layers.directions(policy, table)

    weights = dict(zip(fit.feature_names, fit.reward_weights.tolist(), strict=True))
    return Learned(directions, {"converged": bool(fit.converged), "weights": weights})


def marginal_directions(learned: Learned, layers: Layers, drift: FloatArray) -> FloatArray:
    """(C, 4) probability of moving in each direction of walkers whose drift is one of (Q,)."""
    layer = np.repeat(np.arange(len(layers.each)), np.diff(layers.start))
    n_cells = len(layer)
    cell = np.arange(n_cells) - layers.start[layer]

    def every(values: FloatArray | IntArray) -> IntArray:
        return np.tile(values, len(drift))

    nothing = np.zeros(n_cells * len(drift), dtype=np.int64)
    moves = Moves(
        layer=every(layer),
        cell=every(cell),
        reached=every(cell),
        direction=nothing,
        turned=nothing,
        walker=nothing,
        entered_s=nothing.astype(np.float64),
        dwell_s=np.ones(len(nothing)),
        drift=np.repeat(drift, n_cells),
    )
    asked = replace(layers, moves=moves)
    found = learned.directions(asked)[asked.decided]
    return np.asarray(found.reshape(len(drift), n_cells, 4).mean(axis=0))


def serd(layers: Layers) -> Learned:
    """SERD from states alone, with priors by evidence."""
    return of_fit(fit_mdce_serd(layers.problem, layers.decisions(hidden=True)))


def irl(layers: Layers) -> Learned:
    """Rewards of highest posterior under dynamics that are counted first."""
    problem, decisions = layers.problem, layers.decisions(hidden=False)
    return of_fit(fit_mdce_irl_by_likelihood(problem, decisions, prior=PriorByEvidence()))


def cloning(layers: Layers) -> Learned:
    """Counted directions per bin of the corridor, one added to each direction that is free."""
    assert layers.moves is not None
    by_cell = np.zeros((layers.start[-1], 4))
    np.add.at(by_cell, (layers.cell[layers.decided], layers.moves.direction), 1.0)
    counts = np.concatenate([cells_of_bins(layer.run) for layer in layers.each], axis=1) @ by_cell

    def directions(asked: Layers) -> FloatArray:
        bins = np.concatenate([bins_of(layer.run) for layer in asked.each])[asked.cell]
        free = asked.neighbours != asked.cell[:, None]
        share = np.where(free, counts[bins] + 1.0, 0.0)
        return np.asarray(share / share.sum(axis=1, keepdims=True))

    return Learned(directions, {"converged": True})


def kinds_of(moves: Moves) -> IntArray:
    """(N,) index into `KINDS`."""
    return np.asarray(2 * moves.turned + (moves.direction != AHEAD))


def dwell_design(kind: IntArray) -> FloatArray:
    """(N, F) design of dwell times: the kind of each move."""
    return np.asarray(kind[:, None] == np.arange(len(KINDS)), dtype=np.float64)


def learn_dwell_times(moves: Moves) -> DwellModel:
    """Fit to the moves."""
    kind = kinds_of(moves)
    return fit_dwell_times(moves.dwell_s, dwell_design(kind), kind, moves.walker, len(KINDS))
