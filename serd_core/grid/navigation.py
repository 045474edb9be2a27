"""The high-level navigation problem in a populated hallway (section 5.1 of the thesis).

States are grid cells, actions the four directions and waiting. A decision has an outcome
relative to the intended direction (Table 5.1); its probabilities depend on how the action lies to
the human flow of the cell: with it, against it, across it, or waiting. Moves in cells without flow
count as across it. Outcomes of waiting are relative to the flow of
the cell, so that they can learn being carried along by the crowd (north where there is no flow).
A blocked outcome leaves the robot in its cell. Goal states absorb: their one action is WAIT.

The social norm is that of walking with the people (section 5.1.3): 1 for a move with the flow and
for waiting in it, -1 for a move against it, 0 for the other moves. In a cell without flow there is
nothing to keep to, so it is 0 for every action, and a place without any flow has no such feature.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.checks import (
    float_array,
    int_array,
    nearest,
    number_array,
    require_each,
    require_index,
)
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.grid.grid import Action, Grid, Outcome
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import unique_names
from serd_core.semi_markov.models import NO_LAW, semi_markov_problem

MODEL_NAMES = ("with_flow", "against_flow", "across_flow", "waiting")
GOAL, SOCIAL_NORM, WALL_DISTANCE = "goal", "social_norm", "inverse_wall_distance"
FEATURE_NAMES = (GOAL, SOCIAL_NORM, WALL_DISTANCE)

WITH_FLOW, AGAINST_FLOW, ACROSS_FLOW, WAITING = range(4)
NO_FLOW = -1
#: Outcome that the actions of each model are named after.
INTENDED_OUTCOMES: IntArray = np.array([Outcome.FORWARD] * 3 + [Outcome.STAY], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class NavigationProblem:
    """Section 5.1 as a learning problem; fits the `Problem` protocol.

    grid: the cells; flow: (S,) direction people walk in (`Action.NORTH`..`WEST`) or -1.
    goal_states: sorted indices; mdp: outcome models of `model_names`; features: (S, A, F).
    """

    model_names: ClassVar[tuple[str, ...]] = MODEL_NAMES

    grid: Grid
    flow: IntArray
    goal_states: IntArray
    mdp: Mdp
    outcome_models: OutcomeModels
    features: FloatArray
    feature_names: tuple[str, ...]

    @property
    def by_decisions(self) -> "NavigationProblem":
        """The problem of the thesis, in which every decision takes the same time."""
        return replace(self, mdp=Mdp(self.outcome_models, self.mdp.discount))

    @property
    def with_still_waits(self) -> "NavigationProblem":
        """The same where waiting leads nowhere: of hidden actions none that moved was to wait."""
        if self.mdp.transitions is not self.outcome_models:
            raise SerdError(
                f"transitions must be the outcome models, got {type(self.mdp.transitions).__name__}"
                "; use problem.by_decisions.with_still_waits"
            )
        successors = self.outcome_models.successors.copy()
        successors[:, Action.WAIT] = np.arange(self.grid.n_states)[:, None]
        models = replace(self.outcome_models, successors=successors)
        return replace(self, mdp=Mdp(models, self.mdp.discount), outcome_models=models)

    @property
    def used_models(self) -> IntArray:
        """Rows of `model_names` that apply to some cell and action: without a flow of people no
        move is with or against it."""
        return np.unique(self.outcome_models.model_of)


def build_navigation_problem(
    *,
    grid: Grid,
    flow: IntArray,
    goal_states: Sequence[int] | IntArray,
    wall_distance_m: FloatArray,
    discount: float,
    features: Sequence[str] | None = None,
    own_features: Mapping[str, FloatArray] = MappingProxyType({}),
) -> NavigationProblem:
    """Assemble the problem of section 5.1 on a grid.

    flow: (S,); wall_distance_m: (S,) distance of each cell's centre to the nearest wall;
    features: names out of `FEATURE_NAMES` and own ones, in the wanted order, by default all that
    the place has. own_features: (S,) of each further feature by its name.
    """
    flow = int_array("flow", flow, (grid.n_states,))
    allowed = (flow == NO_FLOW) | ((flow >= Action.NORTH) & (flow <= Action.WEST))
    rule = "be 1 to 4 (north, east, south, west) or -1 for none"
    require_each("flow", flow, allowed, rule, "number directions as in Action")
    features = (*features_of_flow(flow), *own_features) if features is None else features
    goals = int_array("goal_states", np.unique(number_array("goal_states", goal_states)), (None,))
    if not goals.size:
        raise SerdError("goal_states must name at least one state, got none")
    require_index("goal_states", goals, grid.n_states, "a state")
    distance_m = float_array("wall_distance_m", wall_distance_m, (grid.n_states,))
    outcome_models = _outcome_models(grid, flow, goals)
    table = _feature_table(flow, goals, distance_m)
    for name, values in own_features.items():
        column = float_array(f"own_features[{name!r}]", values, (grid.n_states,))
        table[name] = np.repeat(column[:, None], len(Action), axis=1)
    return NavigationProblem(
        grid=grid,
        flow=flow,
        goal_states=goals,
        mdp=Mdp(outcome_models, discount),
        outcome_models=outcome_models,
        features=_selected_features(table, features),
        feature_names=unique_names(tuple(features)),
    )


def with_dwell_times(
    problem: NavigationProblem,
    *,
    patience_s: float,
    wait_s: float,
    log_pace: FloatArray | None = None,
) -> NavigationProblem:
    """The problem with a law of dwell times for each local model of moves (docs/semi_markov.md).

    Its discount is that of a second. patience_s: after which a decision to move that led nowhere
    ends; wait_s: length of a wait. log_pace: (S,) see `semi_markov_problem`.
    """
    stay_s = np.array([patience_s] * WAITING + [wait_s])
    law_of = np.repeat([[*range(WAITING), NO_LAW]], len(Outcome), axis=0).T
    return semi_markov_problem(problem, law_of=law_of, stay_s=stay_s, log_pace=log_pace)


def features_of_flow(flow: IntArray, names: Sequence[str] = FEATURE_NAMES) -> tuple[str, ...]:
    """The features that a place with the flow (S,) has: without any, no social norm.

    >>> features_of_flow(np.array([-1, -1]))
    ('goal', 'inverse_wall_distance')
    """
    has_flow = bool((np.asarray(flow) != NO_FLOW).any())
    return tuple(name for name in names if has_flow or name != SOCIAL_NORM)


def _outcome_models(grid: Grid, flow: IntArray, goals: IntArray) -> OutcomeModels:
    actions, states = np.arange(len(Action))[None, :], np.arange(grid.n_states)[:, None]
    # What FORWARD means: the action, or the flow when waiting, north without one.
    along = np.where(flow == NO_FLOW, int(Action.NORTH), flow)[:, None]
    direction = np.where(actions == Action.WAIT, along, actions)
    successors = np.empty((*direction.shape, len(Outcome)), dtype=np.int64)
    successors[:, :, Outcome.STAY] = states
    for quarter_turns, outcome in enumerate(list(Outcome)[1:]):
        successors[:, :, outcome] = grid.neighbours[states, (direction - 1 + quarter_turns) % 4 + 1]
    successors[goals] = goals[:, None, None]
    available = np.ones((grid.n_states, len(Action)), dtype=np.bool_)
    available[goals] = actions[0] == Action.WAIT
    return OutcomeModels(
        successors=successors,
        model_of=_models_of_actions(flow),
        available=available,
        n_models=len(MODEL_NAMES),
        intended=INTENDED_OUTCOMES,
    )


def _models_of_actions(flow: IntArray) -> IntArray:
    """(S, A) place in `MODEL_NAMES` of each action in cells with the (S,) flow."""
    action, along = np.arange(len(Action))[None, :], flow[:, None]
    opposite = (along + 1) % 4 + 1
    moving = np.where(action == opposite, AGAINST_FLOW, ACROSS_FLOW)
    moving = np.where(action == along, WITH_FLOW, moving)
    moving = np.where(along == NO_FLOW, ACROSS_FLOW, moving)
    return np.where(action == Action.WAIT, WAITING, moving)


def _feature_table(
    flow: IntArray, goals: IntArray, distance_m: FloatArray
) -> dict[str, FloatArray]:
    """(S, A) of each feature of section 5.1.3 that the place has."""
    shape = (len(flow), len(Action))
    goal = np.zeros(shape)
    goal[goals] = 1.0
    norm = np.array([1.0, -1.0, 0.0, 1.0])[_models_of_actions(flow)]
    norm[flow == NO_FLOW] = 0.0
    fix = "measure from the cell's centre"
    require_each("wall_distance_m", distance_m, distance_m > 0, "be above 0", fix)
    inverse = np.broadcast_to((distance_m.min() / distance_m)[:, None], shape)
    table = dict(zip(FEATURE_NAMES, (goal, norm, inverse), strict=True))
    return {name: table[name] for name in features_of_flow(flow)}


def _selected_features(table: dict[str, FloatArray], names: Sequence[str]) -> FloatArray:
    for name in names:
        if name not in table:
            no_flow = "; without a flow of people there is none" if name == SOCIAL_NORM else ""
            meant = no_flow or nearest(name, table)
            raise SerdError(f"features must be among {', '.join(table)}, got {name!r}{meant}")
    if not names:
        raise SerdError(f"features must name at least one of {', '.join(table)}, got none")
    return float_array("features", np.stack([table[name] for name in names], axis=2))
