"""Decision epochs: when a decision ends and the next one is taken.

The thesis decides in states and has no clock (section 5.1.1): a decision ends where the robot has
entered another cell. One that leads nowhere ends as well, with the outcome to stay: after the
patience of the driver or, where the decision was to wait, after the length of a wait. What another
command ended before its time is censored: nobody knows what it would have led to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from serd_core.demonstrations.crossings import CellTracker, Entered
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action, Grid
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

_HYSTERESIS_CELLS = 0.1
#: Places beyond a wall by less are in the cell before it: they are measured, and robots are wide.
_BEYOND_WALLS_CELLS = 1.0
#: A command that is given for less than this (s) ends no decision.
HELD_S = 0.3
#: Shortest time (s) in a cell that was passed at its corner.
LEAST_DWELL_S = 0.02
_SAME_TIME_S = 1e-6


@dataclass(frozen=True)
class Epoch:
    """A decision that ended. next_state: -1 where the robot left the grid.

    action: an `Action`, or `HIDDEN` of a recording without them.
    """

    state: int
    action: int
    begin_s: float
    end_s: float
    next_state: int
    censored: bool = False


def hysteresis_m(grid: Grid) -> float:
    """How far beyond the border of its cell a robot has left it.

    A robot that drives along a border would otherwise decide at every touch.
    """
    return _HYSTERESIS_CELLS * grid.cell_size_m


class DecisionEpochs:
    """Follows one drive; the same for driver, planner and recording. state: -1 off the grid.

    patience_s: after which a decision to move that led nowhere ends; wait_s: one to wait. ended,
    n_lost: decisions of this drive so far that ended, and that are lost.
    """

    def __init__(self, grid: Grid, *, patience_s: float, wait_s: float) -> None:
        self.grid, self._patience_s, self._wait_s = grid, patience_s, wait_s
        self._cells = CellTracker(grid, hysteresis_m(grid))
        self.begin()

    def begin(self) -> None:
        """A drive begins with the next place."""
        self.ended, self.n_lost = list[Epoch](), 0
        self._running: tuple[float, int, int] | None = None
        self.lose()

    def lose(self) -> None:
        """Begin anew with the next place, as after a gap of places; a running decision is lost."""
        self.n_lost += self._running is not None
        self._cells.reset()
        self._seen: tuple[float, bool] | None = None
        self._entered_s: float | None = None
        self._taken_s: float | None = None
        self._running = None

    @property
    def state(self) -> int:
        """The cell in which the robot is."""
        return self._cells.state

    @property
    def action(self) -> Action:
        """What was decided last."""
        return Action.WAIT if self._running is None else Action(self._running[2])

    def begins(self, observation: Observation) -> bool:
        """Whether a decision is to be taken at this observation; the same if it comes again."""
        return self.see(observation.time_s, observation.x_m, observation.y_m)

    def see(self, time_s: float, x_m: float, y_m: float, *, arrived: bool = False) -> bool:
        """Whether a decision is to be taken at this place; `take` it then.

        arrived: the drive ends here, in the goal.
        """
        if self._seen is None or self._seen[0] != time_s:
            self._seen = time_s, self._advance(time_s, x_m, y_m, arrived=arrived)
        return self._seen[1]

    def take(self, time_s: float, action: int) -> None:
        """Begin the decision for an action; one of an earlier time that still runs is censored."""
        if self._taken_s != time_s:
            self.interrupt(time_s)
            self._begin_s = time_s if self._entered_s is None else self._entered_s
            self._entered_s, self._taken_s = None, time_s
        self._running = self._begin_s, self.state, action

    def interrupt(self, time_s: float) -> None:
        """End the running decision without an outcome."""
        if self._running is not None:
            begin_s, state, action = self._running
            if time_s - begin_s > _SAME_TIME_S:
                self.ended.append(Epoch(state, action, begin_s, time_s, state, censored=True))
            self._running = None

    def end(self, time_s: float, x_m: float, y_m: float, *, arrived: bool) -> None:
        """End the drive at a place: what was decided led to the goal, or is censored.

        The goal is entered at its border, less far than a crossing needs, and when the robot
        arrived, also where patience ran out.
        """
        if not self.see(time_s, x_m, y_m, arrived=arrived):
            self.interrupt(time_s)

    def _advance(self, time_s: float, x_m: float, y_m: float, *, arrived: bool) -> bool:
        entered = self._cells.see(time_s, x_m, y_m, is_last=arrived)
        if self._is_elsewhere(x_m, y_m):
            if self._running is not None and not self._is_within(x_m, y_m):
                begin_s, state, action = self._running
                self.ended.append(Epoch(state, action, begin_s, time_s, -1))
                self._running = None
            self.lose()
            entered = self._cells.see(time_s, x_m, y_m)
        if arrived and entered:
            entered = [*entered[:-1], Entered(time_s, entered[-1].state)]
        self._entered_s = entered[-1].time_s if entered else None
        if self._running is None:
            return True
        begin_s, state, action = self._running
        if not entered:
            limit_s = self._wait_s if action == Action.WAIT else self._patience_s
            if arrived or time_s - begin_s < limit_s - _SAME_TIME_S:
                return False
            entered = (Entered(time_s, state),)
        for entered_s, reached in entered:
            end_s = max(entered_s, begin_s + LEAST_DWELL_S)
            if state >= 0 and reached not in (state, *self.grid.neighbours[state]):
                self.n_lost += 1  # through a wall
            else:
                self.ended.append(Epoch(state, action, begin_s, end_s, reached))
            state, begin_s = reached, end_s
        if self._entered_s is not None:
            self._entered_s = begin_s
        self._running = None
        return True

    def _is_elsewhere(self, x_m: float, y_m: float) -> bool:
        """Whether the place is so far beyond a wall that it was not measured wrongly."""
        if self.state < 0:
            return False
        center_x_m, center_y_m = self.grid.centers_m[self.state].tolist()
        farthest_m = (0.5 + _BEYOND_WALLS_CELLS) * self.grid.cell_size_m
        return bool(max(abs(x_m - center_x_m), abs(y_m - center_y_m)) > farthest_m)

    def _is_within(self, x_m: float, y_m: float) -> bool:
        """Whether the place is in the rectangle of the grid, on cells or on walls."""
        (left_m, low_m), size_m = self.grid.origin_m, self.grid.cell_size_m
        rows, columns = self.grid.walkable.shape
        east, north = (x_m - left_m) / size_m, (y_m - low_m) / size_m
        return bool(0 <= east <= columns and 0 <= north <= rows)


def epochs_in(scenario: Scenario) -> DecisionEpochs:
    """Those of drives in a scenario."""
    grid, patience_s, wait_s = scenario.cells.grid, scenario.patience_s, scenario.wait_s
    return DecisionEpochs(grid, patience_s=patience_s, wait_s=wait_s)


def decisions_of(ended: Mapping[int, Sequence[Epoch]], source: str) -> TimedDecisions:
    """The decisions of episodes, by their numbers, that began and ended on the grid."""
    rows = [
        (
            episode,
            each.begin_s,
            each.state,
            int(each.action),
            each.next_state,
            max(each.end_s - each.begin_s, LEAST_DWELL_S),
            each.censored,
        )
        for episode, epochs in ended.items()
        for each in epochs
        if each.state >= 0 and each.next_state >= 0
    ]
    columns = np.array(rows, dtype=np.float64).reshape(-1, 7).T
    return TimedDecisions(
        episode=columns[0].astype(np.int64),
        time_s=columns[1],
        state=columns[2].astype(np.int64),
        action=columns[3].astype(np.int64),
        next_state=columns[4].astype(np.int64),
        dwell_s=columns[5],
        censored=columns[6] > 0,
        source=source,
    )
