"""Markov decision processes without reward: M \\ R (section 2.4 and Table 4.1 of the thesis).

Index order: [s, a] for rewards, features and policies, [s, a, k] for outcomes and [s, a, s'] for
transitions. Actions may be unavailable in a state; absorbing states are those nothing leaves.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from serd_core import checks
from serd_core.arrays import BoolArray, FloatArray, first_index
from serd_core.display import Record
from serd_core.dynamics.outcome_models import SparseModel
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError


@dataclass(frozen=True, eq=False, repr=False)
class Mdp(Record):
    """A discounted Markov decision process whose transitions may still have parameters to learn.

    transitions: P(s' | s, a), `OutcomeModels` or what `fixed_transitions` returns; discount: gamma
    in [0, 1) per decision. Raises SerdError where a state has no action.

        mdp = sc.Mdp(models, 0.95)
    """

    transitions: TransitionModel
    discount: float

    def __post_init__(self) -> None:
        checks.require_kind(
            "transitions", self.transitions, (TransitionModel,), "OutcomeModels(...)"
        )
        if not (checks.is_number(self.discount) and 0.0 <= self.discount < 1.0):
            raise SerdError(
                f"discount must be in [0, 1), got {checks.shown(self.discount)}; use for example"
                " 0.99"
            )
        object.__setattr__(self, "discount", float(self.discount))
        self.transitions.require_discount(self.discount)
        listed = isinstance(self.transitions, SparseModel)
        checks.require_memory(
            f"the transitions of {self.n_states} states and {self.n_actions} actions",
            (checks.LISTED_BYTES_PER_ENTRY if listed else checks.BYTES_PER_ENTRY)
            * self.transitions.n_entries,
            "use fewer states, or fewer outcomes of each action",
        )
        if (stuck := first_index(~self.available.any(axis=1))) is not None:
            raise SerdError(
                f"state {stuck[0]} must have at least one available action, got none"
                "; give an absorbing state one action that stays"
            )

    @property
    def available(self) -> BoolArray:
        """(S, A) which actions exist in which states."""
        return self.transitions.available

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return self.transitions.n_states

    @property
    def n_actions(self) -> int:
        """Number of actions A."""
        return self.transitions.n_actions

    @cached_property
    def absorbing(self) -> BoolArray:
        """(S,) states that no action can leave."""
        return self.transitions.absorbing

    @cached_property
    def final(self) -> BoolArray:
        """(S,) absorbing states with one action: an episode is over, as nothing is left to decide.

        Experts that stay for good but choose between actions go on making decisions.
        """
        return np.asarray(self.absorbing & (self.available.sum(axis=1) == 1))


#: How far a sum may be from 1; tables read from files are rounded.
SUM_TOLERANCE = 1e-6
#: How far below 0 a probability may be.
ROUNDING = 1e-9


def checked_policy(name: str, values: Any, mdp: Mdp) -> FloatArray:
    """(S, A) copy of a policy, given as such or as what `soft_policy` returns; SerdError naming the
    first state whose row is no distribution.
    """
    values = getattr(values, "probabilities", values)
    policy = checks.float_array(name, values, mdp.available.shape)
    allowed = (policy >= -ROUNDING) & (mdp.available | (policy == 0.0))
    rule = "be a probability of an available action"
    checks.require_each(name, policy, allowed, rule, "use 0 for actions that are not available")
    sums = policy.sum(axis=1)
    is_one = np.abs(sums - 1.0) <= SUM_TOLERANCE
    checks.require_each(name, sums, is_one, "sum to 1", "normalise over actions")
    return policy


def checked_distribution(name: str, values: FloatArray, size: int) -> FloatArray:
    """(size,) copy of a distribution; SerdError where it is none."""
    share = checks.float_array(name, values, (size,))
    checks.require_each(name, share, share >= 0, "not be negative", "use 0 for never")
    if abs(float(share.sum()) - 1.0) > SUM_TOLERANCE:
        raise SerdError(f"{name} must sum to 1, got a sum of {share.sum()}; normalise it")
    return share
