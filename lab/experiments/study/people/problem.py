"""Moves between the cells of a corridor as a decision problem in the mean crowd.

The states are the cells of layers that nothing connects: one layer per run and walking direction,
with the mean field of the crowd of the people learned from. All layers share rewards and outcome
models.

Every decision is a crossing, so it leads to a neighbour. Actions are the four directions, outcomes
those of Table 5.1 without staying. A blocked outcome leads where the action does, and an action
into a wall is not available. The last column is the goal.

A plan does not know how its walker will move within later cells, but the present velocity is known.
So each decision has a state of its own: that of its cell together with the walker's drift, which is
the lateral offset in half cells at which that velocity would leave the cell ahead. No move leads
to these states.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lab.experiments.study.people.crowd import Field
from lab.experiments.study.people.recordings import Run, Walker
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.demonstrations.decisions import HIDDEN, Decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.grid.grid import Action
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem

DIRECTIONS = (Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST)
AHEAD = DIRECTIONS.index(Action.EAST)
FEATURES = ("goal", "across", "wall", "left", "same way", "opposite way", "drift")
MODELS = ("with flow", "against flow", "across")
MOST_DRIFT, SLOWEST_MPS = 3.0, 0.2


@dataclass(frozen=True, eq=False)
class Layer:
    """The crowd of a run as those of one direction see it."""

    run: Run
    field: Field


@dataclass(frozen=True, eq=False)
class Moves:
    """(N,) crossings of walkers: layer, cell, cell reached, direction (0 to 3), kinds and times.

    layer: 2 run + 1 of those who are not turned, 2 run of the others; turned: whether the cell was
    entered by another direction than ahead; walker: number of the person in the study; drift: see
    above. A person's first cell is left out, as its dwell time is not known.
    """

    layer: IntArray
    cell: IntArray
    reached: IntArray
    direction: IntArray
    turned: IntArray
    walker: IntArray
    entered_s: FloatArray
    dwell_s: FloatArray
    drift: FloatArray

    def __len__(self) -> int:
        return len(self.cell)

    def select(self, rows: BoolArray | IntArray) -> "Moves":
        """Those of the rows (mask or indices)."""
        return Moves(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class Layers:
    """The decision problem on layers.

    moves: that have states of their own, after the C cells of all layers; None for none.
    """

    each: tuple[Layer, ...]
    discount: float
    moves: Moves | None = None

    @cached_property
    def start(self) -> IntArray:
        """(L + 1,) first state of each layer."""
        return np.concatenate([[0], np.cumsum([layer.run.grid.n_states for layer in self.each])])

    @cached_property
    def cell(self) -> IntArray:
        """(S,) the cell of each state, numbered through all layers."""
        cells = np.arange(self.start[-1])
        if self.moves is None:
            return cells
        return np.concatenate([cells, self.start[self.moves.layer] + self.moves.cell])

    @property
    def decided(self) -> IntArray:
        """(N,) the state of each of the moves."""
        return np.arange(self.start[-1], len(self.cell))

    @cached_property
    def problem(self) -> TabularProblem:
        """States layer by layer; actions and outcomes in the order of `DIRECTIONS`."""
        ahead, here, goal = self.neighbours, self.cell, self._goal
        available = ahead != here[:, None]
        available[goal] = np.arange(4) == AHEAD
        features = self._features(self._target, goal)
        models = self._models(self._successors(ahead, goal), available, self._target)
        return TabularProblem(Mdp(models, self.discount), features, FEATURES)

    def directions(self, policy: FloatArray, table: FloatArray) -> FloatArray:
        """(S, 4) probability of moving in each of `DIRECTIONS`, for an (S, A) policy and (M, K)."""
        models = self.problem.mdp.transitions
        assert isinstance(models, OutcomeModels)
        share = policy[:, :, None] * table[models.model_of]
        ahead = self.neighbours
        found = [
            np.sum(share * (models.successors == ahead[:, d, None, None]), axis=(1, 2))
            * (ahead[:, d] != self.cell)
            for d in range(4)
        ]
        return np.stack(found, axis=1)

    @cached_property
    def neighbours(self) -> IntArray:
        """(S, 4) cell in each of `DIRECTIONS`; the cell itself at a wall."""
        pairs = zip(self.each, self.start[:-1], strict=True)
        return np.concatenate([neighbours(layer.run) + first for layer, first in pairs])[self.cell]

    @cached_property
    def _goal(self) -> BoolArray:
        """(S,) mask of the last columns."""
        return np.concatenate([is_goal(layer.run) for layer in self.each])[self.cell]

    @cached_property
    def _target(self) -> IntArray:
        """(S, 4) cell that each action aims at."""
        return np.where(self._goal[:, None], self.cell[:, None], self.neighbours)

    @property
    def goal_states(self) -> IntArray:
        """States of the last columns."""
        return np.flatnonzero(np.concatenate([is_goal(layer.run) for layer in self.each]))

    def _successors(self, ahead: IntArray, goal: BoolArray) -> IntArray:
        """(S, A, K): outcomes turn from the direction of the action to the right."""
        here = self.cell[:, None]
        turns = (np.arange(4)[:, None] + np.arange(4)[None, :]) % 4
        table = ahead[:, turns]
        free = np.where(table == here[:, :, None], ahead[:, :, None], table)
        return np.where(goal[:, None, None], here[:, :, None], free)

    def field(self, name: str) -> FloatArray:
        """(C,) one of the fields of the crowd."""
        return np.concatenate([getattr(layer.field, name) for layer in self.each])

    def _features(self, target: IntArray, goal: BoolArray) -> FloatArray:
        across = np.zeros(target.shape)
        across[:, DIRECTIONS.index(Action.NORTH)] = across[:, DIRECTIONS.index(Action.SOUTH)] = 1
        wall = np.concatenate([_wall(layer.run) for layer in self.each])
        left = np.concatenate([_left(layer.run) for layer in self.each])
        same, opposite = self.field("same_pm2"), self.field("opposite_pm2")
        goals = np.broadcast_to(goal[:, None].astype(np.float64), target.shape)
        columns = [goals, across, wall[target], left[target], same[target], opposite[target]]
        drift = np.zeros(target.shape)
        if self.moves is not None:
            for side, action in ((1, Action.NORTH), (-1, Action.SOUTH)):
                drift[self.decided, DIRECTIONS.index(action)] = side * self.moves.drift
        table = np.stack([*columns, drift], axis=2)
        table[goal, :, 1:] = 0.0
        return table

    def _models(
        self, successors: IntArray, available: BoolArray, target: IntArray
    ) -> OutcomeModels:
        same, opposite = self.field("same_pm2")[target], self.field("opposite_pm2")[target]
        back = np.arange(4) == DIRECTIONS.index(Action.WEST)
        against = (opposite > same) ^ back
        across = np.isin(DIRECTIONS, (Action.NORTH, Action.SOUTH))
        which = np.where(across, 2, against.astype(np.int64))
        return OutcomeModels(
            successors, which, available, n_models=len(MODELS), intended=np.zeros(3, np.int64)
        )

    def decisions(self, *, hidden: bool) -> Decisions:
        """The moves as decisions; their direction is the action unless that is hidden."""
        moves = self.moves
        assert moves is not None
        return Decisions(
            episode=moves.walker,
            time_s=moves.entered_s + 1e-6 * np.arange(len(moves)),
            state=self.decided,
            action=np.full(len(moves), HIDDEN) if hidden else moves.direction,
            next_state=self.start[moves.layer] + moves.reached,
        )


def neighbours(run: Run) -> IntArray:
    """(C, 4) cell in each of `DIRECTIONS`; the cell itself at a wall."""
    return run.grid.neighbours[:, list(DIRECTIONS)]


def is_goal(run: Run) -> BoolArray:
    """(C,) mask of the last column."""
    return np.asarray(run.grid.cells[:, 1] == run.n_columns - 1)


def _wall(run: Run) -> FloatArray:
    """(C,) 1 beside a wall, falling as the inverse distance of the centre."""
    half = run.grid.walkable.shape[0] * run.grid.cell_size_m / 2
    distance = half - np.abs(run.grid.centers_m[:, 1])
    return np.asarray(run.grid.cell_size_m / 2 / distance)


def _left(run: Run) -> FloatArray:
    """(C,) from -1 at the right wall to 1 at the left one."""
    half = run.grid.walkable.shape[0] * run.grid.cell_size_m / 2
    return np.asarray(run.grid.centers_m[:, 1] / half)


def _drift(run: Run, walker: Walker, j: int) -> float:
    """Where the velocity at crossing j leaves the cell ahead, in half cells left of its middle."""
    time_s, size_m = float(walker.crossings.entered_s[j]), run.grid.cell_size_m
    x_m, y_m = walker.at(time_s) - run.grid.centers_m[walker.crossings.state[j]]
    ahead_mps, left_mps = walker.velocity_mps(time_s)
    left_s = (size_m / 2 - x_m) / max(ahead_mps, SLOWEST_MPS)
    return float(np.clip((y_m + left_mps * left_s) / (size_m / 2), -MOST_DRIFT, MOST_DRIFT))


def moves_of(runs: Sequence[Run]) -> Moves:
    """All moves before the goal, run by run and person by person."""
    rows, number = [], 0
    for index, run in enumerate(runs):
        table = neighbours(run)
        for walker in run.walkers:
            state, entered = walker.crossings.state, walker.crossings.entered_s
            turned = False
            for j in range(run.arrival_of(walker)):
                direction = int(np.argmax(table[state[j]] == state[j + 1]))
                dwell_s = max(entered[j + 1] - entered[j], 1e-3)
                if j:
                    rows.append(
                        (layer_of(index, walker), state[j], state[j + 1], direction, int(turned),
                         number, entered[j], dwell_s, _drift(run, walker, j))
                    )  # fmt: skip
                turned = direction != AHEAD
            number += 1
    columns = np.array(rows, dtype=np.float64).T
    return Moves(*columns[:6].astype(np.int64), *columns[6:])


def layer_of(run: int, walker: Walker) -> int:
    """Number of the layer of a walker of the run of that number."""
    return 2 * run + (walker.sign > 0)
