"""Demonstrations of decisions that take time.

A decision lasts until its outcome is reached, or until another command ends it first. Then neither
outcome nor dwell time is known, only that the dwell time is longer than what was seen of it
(right-censored), and that the action was chosen.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, bool_array, float_array, require_each
from serd_core.demonstrations.decisions import COLUMNS, Decisions

TIMED_COLUMNS = (*COLUMNS, "dwell_s", "censored")


@dataclass(frozen=True, eq=False, kw_only=True)
class TimedDecisions(Decisions):
    """N decisions with their dwell times.

    dwell_s: (N,) seconds from a decision to its outcome, or to the command that ended it; above 0.
    censored: (N,) which ones a command ended; their next_state is their state, as nothing was
    reached, and counts as no outcome.

        sc.TimedDecisions([0, 0], [0.0, 1.4], state=[0, 1], action=[0, 0], next_state=[1, 1],
            dwell_s=[1.4, 0.9], censored=[False, True])
    """

    dwell_s: FloatArray
    censored: BoolArray

    def __post_init__(self) -> None:
        super().__post_init__()
        dwell = float_array("dwell_s", self.dwell_s, (len(self.time_s),))
        require_each("dwell_s", dwell, dwell > 0, "be above 0", "merge decisions at one time")
        censored = bool_array("censored", self.censored, (len(self.time_s),))
        moved = censored & (self.next_state != self.state)
        fix = "repeat the state where a command ended the decision"
        require_each("next_state", self.next_state, ~moved, "be the state where censored", fix)
        object.__setattr__(self, "dwell_s", dwell)
        object.__setattr__(self, "censored", censored)

    def columns(self) -> dict[str, Any]:
        """The columns by name."""
        return {**super().columns(), "dwell_s": self.dwell_s, "censored": self.censored}


def reached(decisions: Decisions) -> BoolArray:
    """(N,) decisions that ended in an outcome."""
    if isinstance(decisions, TimedDecisions):
        return ~decisions.censored
    return np.ones(len(decisions), dtype=np.bool_)
