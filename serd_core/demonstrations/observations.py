"""The counts of demonstrations that the likelihood depends on.

P(D | theta) of (4.7) is a product over decisions, so n(s, a) and n(s, a, s') are sufficient.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions, state_action_counts
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp


@dataclass(frozen=True, eq=False)
class Observations:
    """Sufficient statistics of demonstrations in one MDP.

    state_action: (S, A) counts n(s, a).
    group: distinct observed transitions as indices into `mdp.transitions.groups`;
    group_count: how often each was observed.
    entry: entries of P that belong to an observed transition; entry_group: place of each in
    `group`.
    """

    state_action: FloatArray
    group: IntArray
    group_count: FloatArray
    entry: IntArray
    entry_group: IntArray

    @property
    def n_decisions(self) -> int:
        """Number of decisions."""
        return int(self.state_action.sum())


def observe(mdp: Mdp, decisions: Decisions, name: str = "decisions") -> Observations:
    """Count; SerdError naming the first decision the MDP rules out."""
    if not len(decisions):
        raise SerdError(f"{name} must hold at least one decision, got none; record an episode")
    _require_distinct_times(decisions, name)
    counts = state_action_counts(decisions, mdp.n_states, mdp.n_actions)
    _require_available(mdp, decisions, name)
    group_of_decision = _observed_groups(mdp, decisions, name)
    group, count = np.unique(group_of_decision, return_counts=True)
    place = np.full(len(mdp.transitions.groups), -1, dtype=np.int64)
    place[group] = np.arange(len(group))
    place_of_entry = place[mdp.transitions.groups.group_of_entry]
    entry = np.flatnonzero(place_of_entry >= 0)
    return Observations(
        state_action=counts,
        group=group,
        group_count=count.astype(np.float64),
        entry=entry,
        entry_group=place_of_entry[entry],
    )


def explained(mdp: Mdp, decisions: Decisions) -> BoolArray:
    """(N,) which decisions the MDP allows; every learner rejects the others."""
    inside = (decisions.state < mdp.n_states) & (decisions.next_state < mdp.n_states)
    inside &= decisions.action < mdp.n_actions
    row = decisions.state * mdp.n_actions + decisions.action
    found = mdp.transitions.groups.find(row, decisions.next_state) >= 0
    return np.asarray(inside & found)


def _require_distinct_times(decisions: Decisions, name: str) -> None:
    order = np.lexsort((decisions.time_s, decisions.episode))
    episode, time_s = decisions.episode[order], decisions.time_s[order]
    twice = np.flatnonzero((np.diff(episode) == 0) & (np.diff(time_s) == 0))
    if twice.size:
        first, second = sorted(order[twice[0] : twice[0] + 2].tolist())
        raise SerdError(
            f"{name} must have one decision per episode and time, got {name}[{first}] and"
            f" {name}[{second}] both in episode {decisions.episode[first]} at"
            f" {decisions.time_s[first]} s; drop one, or number the decisions of the episode"
        )


def _require_available(mdp: Mdp, decisions: Decisions, name: str) -> None:
    wrong = np.flatnonzero(~mdp.available[decisions.state, decisions.action])
    if wrong.size:
        first = int(wrong[0])
        raise SerdError(
            f"{name}[{first}] takes action {decisions.action[first]} in state"
            f" {decisions.state[first]}, where it is not available; drop that decision"
        )


def _observed_groups(mdp: Mdp, decisions: Decisions, name: str) -> IntArray:
    row = decisions.state * mdp.n_actions + decisions.action
    outside = np.flatnonzero(decisions.next_state >= mdp.n_states)
    found = mdp.transitions.groups.find(row, np.minimum(decisions.next_state, mdp.n_states - 1))
    found[outside] = -1
    wrong = np.flatnonzero(found < 0)
    if wrong.size:
        first = int(wrong[0])
        raise SerdError(
            f"{name}[{first}] reaches state {decisions.next_state[first]} from state"
            f" {decisions.state[first]} by action {decisions.action[first]}, which no outcome"
            " explains; drop that decision or extend the model"
        )
    return found
