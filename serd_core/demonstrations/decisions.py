"""Expert demonstrations D as one table of decisions (s, a, s') (Eqs. 3.1 and 3.2).

Rows of one episode share an episode number; `time_s` orders them. A decision that takes time lasts
until its outcome is reached, or until another command ends it first. Then neither outcome nor dwell
time is known, only that the dwell time is longer than what was seen of it (right-censored).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from serd_core import checks
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.display import html_table
from serd_core.errors import SerdError

COLUMNS = ("episode", "time_s", "state", "action", "next_state")
#: Marks a decision whose action was not observed.
HIDDEN = -1
#: Decisions that a notebook shows.
FIRST_ROWS = 5
_Own = TypeVar("_Own", bound="Decisions")


@dataclass(frozen=True, eq=False, repr=False)
class Decisions:
    """What was demonstrated: N decisions, each a state, an action and the state it led to.

        sc.Decisions([0, 0], [0.0, 1.0], state=[0, 1], action=[1, 1], next_state=[1, 2])

    episode: (N,) number of the episode, any non-negative integers.
    time_s: (N,) when the decision was taken, in seconds.
    state, action, next_state: (N,) indices of the problem they were made in; action is `HIDDEN`
    where only the states were observed.
    source: where they come from, for reports.

    Raises SerdError where columns have other lengths or hold what is no index.
    """

    episode: IntArray
    time_s: FloatArray
    state: IntArray
    action: IntArray
    next_state: IntArray
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", checks.float_array("time_s", self.time_s, (None,)))
        for name in ("episode", "state", "action", "next_state"):
            column = checks.int_array(name, getattr(self, name), (None,))
            if len(column) != len(self.time_s):
                raise SerdError(
                    f"{name} must have one entry per decision ({len(self.time_s)} as in time_s),"
                    f" got {len(column)}"
                )
            least, rule = 0, "not be negative"
            if name == "action":
                least, rule = HIDDEN, f"be an index or {HIDDEN} for a hidden action"
            checks.require_each(
                name, column, column >= least, rule, "drop decisions outside the problem"
            )
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.state)

    def __repr__(self) -> str:
        hidden = f", {self.hidden.sum()} with hidden actions" if self.hidden.any() else ""
        n = len(self.episodes)
        size = f"{len(self)} decisions in {n} episode{'s' * (n != 1)}{hidden}"
        return f"<{type(self).__name__}: {size}{self.source and ', '}{self.source}>"

    def _repr_html_(self) -> str:
        columns = self.columns()
        rows = [*zip(*(each[:FIRST_ROWS].tolist() for each in columns.values()), strict=True)]
        more = [("...",) * len(columns)] if len(self) > FIRST_ROWS else []
        return html_table(repr(self)[1:-1], columns, *rows, *more)

    def columns(self) -> dict[str, Any]:
        """The columns by name, as `pandas.DataFrame` takes them."""
        names = (field.name for field in fields(self) if field.name != "source")
        return {name: getattr(self, name) for name in names}

    @property
    def hidden(self) -> BoolArray:
        """(N,) decisions whose action was not observed."""
        return np.asarray(self.action == HIDDEN)

    def with_hidden_actions(self: _Own, rows: BoolArray | None = None) -> _Own:
        """The same decisions without the actions of the given rows (N,), by default of all."""
        wanted = True if rows is None else checks.bool_array("rows", rows, (len(self),))
        return replace(self, action=np.where(wanted, HIDDEN, self.action))

    @property
    def episodes(self) -> IntArray:
        """Sorted numbers of the episodes that have at least one decision."""
        return np.unique(self.episode)

    def select(self: _Own, rows: BoolArray | IntArray) -> _Own:
        """The decisions of the given rows (mask (N,) or indices), in that order."""
        chosen = checks.chosen_indices("rows", rows, len(self), "a row")
        return replace(self, **{name: each[chosen] for name, each in self.columns().items()})

    def select_episodes(self: _Own, episodes: Iterable[int]) -> _Own:
        """All decisions of the given episode numbers; SerdError for one that is not there."""
        wanted = np.unique(checks.int_array("episodes", list(episodes), (None,)))
        if (missing := np.setdiff1d(wanted, self.episode)).size:
            raise SerdError(
                f"episodes must be among {self.episodes.tolist()}, got {int(missing[0])}"
                "; choose from that list"
            )
        return self.select(np.isin(self.episode, wanted))


def state_action_counts(decisions: Decisions, n_states: int, n_actions: int) -> FloatArray:
    """(S, A) how often each action was taken in each state: n(s, a); all must be known."""
    require_shown(decisions, "counts of actions")
    _require_below("state", decisions.state, n_states)
    _require_below("action", decisions.action, n_actions)
    pair = decisions.state * n_actions + decisions.action
    counts = np.bincount(pair, minlength=n_states * n_actions)
    return counts.astype(np.float64).reshape(n_states, n_actions)


def require_shown(decisions: Decisions, purpose: str) -> None:
    """SerdError naming the first decision whose action is hidden."""
    require_decisions(decisions)
    if (rows := np.flatnonzero(decisions.hidden)).size:
        raise SerdError(
            f"action[{rows[0]}] must be known for {purpose}, got a hidden one; learn by"
            " fit_mdce_serd or fit_pm_serd, which need states only"
        )


def require_decisions(decisions: object, name: str = "decisions") -> None:
    """SerdError unless an argument is a `Decisions` object."""
    checks.require_kind(name, decisions, (Decisions,), "decisions_from_episodes(episodes)")


def state_counts(decisions: Decisions, n_states: int) -> FloatArray:
    """(S,) how often a decision was taken in each state: n(s)."""
    _require_below("state", decisions.state, n_states)
    return np.bincount(decisions.state, minlength=n_states).astype(np.float64)


def start_distribution(decisions: Decisions, n_states: int) -> FloatArray:
    """(S,) share of trajectories that start in each state: empirical P(s0)."""
    _require_below("state", decisions.state, n_states)
    rows, begins = rows_by_trajectory(decisions)
    if not len(rows):
        raise SerdError("decisions must hold at least one decision, got none; record an episode")
    first = rows[begins]
    return np.bincount(decisions.state[first], minlength=n_states) / len(first)


def rows_by_trajectory(decisions: Decisions) -> tuple[IntArray, BoolArray]:
    """(N,) rows by episode and time, and (N,) whether a trajectory begins with each of these."""
    rows = np.lexsort((decisions.time_s, decisions.episode))
    begins = np.ones(len(rows), dtype=np.bool_)
    before, after = rows[:-1], rows[1:]
    other = decisions.episode[before] != decisions.episode[after]
    begins[1:] = other | (decisions.next_state[before] != decisions.state[after])
    return rows.astype(np.int64), begins


def _require_below(name: str, column: IntArray, size: int) -> None:
    fix = "the decisions were made in another problem"
    checks.require_each(name, column, column < size, f"be below {size}", fix)


def decisions_from_episodes(
    episodes: Iterable[tuple[Sequence[int], Sequence[int]]], source: str = ""
) -> Decisions:
    """Make decisions from (states, actions) of each episode, with one more state than actions.

    Time counts in decisions. SerdError where an episode has other numbers of states and actions.

        decisions = sc.decisions_from_episodes([([0, 1, 2], [3, 3]), ([0, 4], [1])])
    """
    rows = []
    for number, episode in enumerate(episodes):
        try:
            states, actions = episode
        except (TypeError, ValueError) as error:
            raise SerdError(
                f"episode {number} must be a pair (states, actions), got {checks.shown(episode)};"
                " leave out anything else"
            ) from error
        visited = checks.int_array(f"states of episode {number}", states, (None,))
        chosen = checks.int_array(f"actions of episode {number}", actions, (None,))
        if len(visited) != len(chosen) + 1:
            raise SerdError(
                f"episode {number} must have one more state than actions, got {len(visited)} and"
                f" {len(chosen)}; add the state after the last action"
            )
        step = np.arange(len(chosen))
        rows.append((np.full(len(chosen), number), step, visited[:-1], chosen, visited[1:]))
    if not rows:
        raise SerdError("episodes must hold at least one episode, got none; record an episode")
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    return Decisions(**dict(zip(COLUMNS, columns, strict=True)), source=source)


TIMED_COLUMNS = (*COLUMNS, "dwell_s", "censored")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
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
        dwell = checks.float_array("dwell_s", self.dwell_s, (len(self.time_s),))
        checks.require_each(
            "dwell_s", dwell, dwell > 0, "be above 0", "merge decisions at one time"
        )
        censored = checks.bool_array("censored", self.censored, (len(self.time_s),))
        moved = censored & (self.next_state != self.state)
        fix = "repeat the state where a command ended the decision"
        checks.require_each(
            "next_state", self.next_state, ~moved, "be the state where censored", fix
        )
        object.__setattr__(self, "dwell_s", dwell)
        object.__setattr__(self, "censored", censored)


def reached(decisions: Decisions) -> BoolArray:
    """(N,) decisions that ended in an outcome."""
    if isinstance(decisions, TimedDecisions):
        return ~decisions.censored
    return np.ones(len(decisions), dtype=np.bool_)
