"""The counts of demonstrations that the likelihood depends on.

P(D | theta) of (4.7) is a product over decisions, so n(s, a) and n(s, a, s') are sufficient. Where
actions are hidden it has the factor sum_a pi(a | s) P(s' | s, a), and m(s, s') is sufficient.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray, weighted_counts
from serd_core.demonstrations.decisions import (
    Decisions,
    reached,
    require_decisions,
    state_action_counts,
    state_counts,
)
from serd_core.dynamics.transition_model import TransitionModel, places_of
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, require_problem
from serd_core.semi_markov.dwell_likelihood import DwellObservations, dwell_times


@dataclass(frozen=True, eq=False)
class HiddenMoves:
    """Observed (s, s') whose action is hidden, and the transitions (s, a, s') that explain each.

    count: (T,) how often each distinct (s, s') was observed.
    place, move: (H,) of each explaining transition, in `Observations.key` and among the T.
    """

    count: FloatArray
    place: IntArray
    move: IntArray

    def __bool__(self) -> bool:
        return bool(len(self.count))


@dataclass(frozen=True, eq=False)
class Observations:
    """Sufficient statistics of demonstrations in one MDP.

    state_action: (S, A) counts n(s, a) of decisions with their action.
    key: (G,) sorted numbers (s * A + a) * S + s' of distinct transitions, those observed and those
    that explain a hidden action; group_count: how often each was observed.
    local_index: of the entries of P that belong to one of these, places in the flattened local
    probabilities; entry_group: place of each in `key`.
    hidden: moves whose action is hidden. dwells: how long decisions took, None where that is not a
    part of the dynamics. Decisions that a command ended count in `state_action` alone.
    """

    state_action: FloatArray
    key: IntArray
    group_count: FloatArray
    local_index: IntArray
    entry_group: IntArray
    hidden: HiddenMoves
    dwells: DwellObservations | None = None

    @property
    def n_decisions(self) -> int:
        """Number of decisions, with and without their action."""
        return int(self.state_action.sum() + self.hidden.count.sum())

    def counts(self, model: TransitionModel) -> FloatArray:
        """How often each of the model's distinct transitions (`groups`) was observed."""
        counts = np.zeros(len(model.groups))
        counts[model.groups.places(self.key)] = self.group_count
        return counts

    def probabilities(self, local_probabilities: FloatArray) -> FloatArray:
        """(G,) probability of each transition."""
        seen = np.ravel(local_probabilities)[self.local_index]
        return weighted_counts(self.entry_group, seen, len(self.key))


def observe(problem: Problem, decisions: Decisions, name: str = "decisions") -> Observations:
    """The counts of decisions; SerdError naming the first one that the MDP rules out."""
    require_problem(problem)
    require_decisions(decisions, name)
    mdp = problem.mdp
    if not len(decisions):
        raise SerdError(f"{name} must hold at least one decision, got none; record an episode")
    _require_distinct_times(decisions, name)
    state_counts(decisions, mdp.n_states)
    shown, ended = np.flatnonzero(~decisions.hidden), reached(decisions)
    counts = state_action_counts(decisions.select(shown), mdp.n_states, mdp.n_actions)
    _require_possible(mdp, decisions, name)
    observed = taken_transitions(mdp, decisions)[shown[ended[shown]]]
    hidden = decisions.select(decisions.hidden & ended)
    pairs = np.stack([hidden.state, hidden.next_state], axis=1)
    _, first, moves = np.unique(pairs, axis=0, return_index=True, return_counts=True)
    candidates = explaining_transitions(mdp, hidden.select(first))
    move, column = np.nonzero(candidates >= 0)
    keys = np.unique(np.concatenate([observed, candidates[move, column]]))
    model = mdp.transitions.moves
    entry_group = places_of(model.row * mdp.n_states + model.successor, keys)
    kept = entry_group >= 0
    place = places_of(candidates[move, column], keys)
    return Observations(
        state_action=counts,
        key=keys,
        group_count=np.bincount(places_of(observed, keys), minlength=len(keys)).astype(np.float64),
        local_index=model.local_index[kept],
        entry_group=entry_group[kept],
        hidden=HiddenMoves(moves.astype(np.float64), place, move),
        dwells=dwell_times(mdp, decisions, name),
    )


def explained(mdp: Mdp, decisions: Decisions) -> BoolArray:
    """(N,) which decisions the MDP allows; every learner rejects the others."""
    ended = reached(decisions)
    found, hidden = (taken_transitions(mdp, decisions) >= 0) | ~ended, decisions.hidden & ended
    found[hidden] = np.any(explaining_transitions(mdp, decisions.select(hidden)) >= 0, axis=1)
    return np.asarray(found)


def _require_distinct_times(decisions: Decisions, name: str) -> None:
    order = np.lexsort((decisions.time_s, decisions.episode))
    episode, time_s = decisions.episode[order], decisions.time_s[order]
    if (twice := np.flatnonzero((np.diff(episode) == 0) & (np.diff(time_s) == 0))).size:
        first, second = sorted(order[twice[0] : twice[0] + 2].tolist())
        raise SerdError(
            f"{name} must have one decision per episode and time, got {name}[{first}] and"
            f" {name}[{second}] both in episode {decisions.episode[first]} at"
            f" {decisions.time_s[first]} s; drop one, or number the decisions of the episode"
        )


def explaining_transitions(mdp: Mdp, decisions: Decisions) -> IntArray:
    """(N, A) key of the transition (s, a, s') of each action it may have been, else -1."""
    actions = np.arange(mdp.n_actions)
    found = _found(mdp, decisions.state[:, None], actions, decisions.next_state[:, None])
    return np.where(decisions.hidden[:, None] | (decisions.action[:, None] == actions), found, -1)


def taken_transitions(mdp: Mdp, decisions: Decisions) -> IntArray:
    """(N,) key of the transition (s, a, s') of each decision; -1 for none or a hidden action."""
    found = _found(mdp, decisions.state, decisions.action, decisions.next_state)
    inside = (decisions.action >= 0) & (decisions.action < mdp.n_actions)
    return np.where(inside, found, -1)


def _found(mdp: Mdp, state: IntArray, action: IntArray, following: IntArray) -> IntArray:
    """Key of the transition of each triple, with broadcast shapes; -1 where there is none."""
    inside = (state < mdp.n_states) & (following < mdp.n_states)
    row, successor = np.broadcast_arrays(
        np.where(inside, state, 0) * mdp.n_actions + np.clip(action, 0, mdp.n_actions - 1),
        np.where(inside, following, 0),
    )
    key = row * mdp.n_states + successor
    return np.where(inside & (mdp.transitions.groups.places(key) >= 0), key, -1)


def _require_possible(mdp: Mdp, decisions: Decisions, name: str) -> None:
    given = mdp.available[decisions.state, decisions.action] | decisions.hidden
    if (wrong := np.flatnonzero(~given)).size:
        raise SerdError(
            f"{name}[{wrong[0]}] takes action {decisions.action[wrong[0]]} in state"
            f" {decisions.state[wrong[0]]}, where it is not available; drop that decision"
        )
    if (wrong := np.flatnonzero(~explained(mdp, decisions))).size:
        first = int(wrong[0])
        action = f"action {decisions.action[first]}"
        raise SerdError(
            f"{name}[{first}] reaches state {decisions.next_state[first]} from state"
            f" {decisions.state[first]} by {'any action' if decisions.hidden[first] else action},"
            " which no outcome explains; drop that decision or extend the model"
        )
