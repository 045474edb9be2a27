"""Drivers: their interface, and those that commands and tables name; a model file is a name too."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import numpy as np
import scipy  # loads sparse at its first use

from serd_bag.nearest import choice_rule
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_sim.errors import SimError
from serd_sim.scenario.grid import flow_of, goal_states_of, grid_of
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import EXPERT, Observation, episode_rng

MOVES = (Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST)


@dataclass(frozen=True)
class RouteCosts:
    """Costs in units of one move."""

    against_flow: float = 4.0
    across_flow: float = 0.5
    turning: float = 0.4
    lane_dislike: float = 0.35


@dataclass(frozen=True)
class ExpertSettings:
    """waver_probability: of taking another move that costs at most `waver_cost` more.

    wait_probability: of waiting when a person will be within `blocked_radius_m` of the next cell's
    centre within `look_ahead_s`; never more than `longest_wait` times in a row.
    goes_with_flow: False for an expert who prefers the side of oncoming people.
    reaction_delay_s: how old the places are at which it sees people, by their present velocity.
    """

    costs: RouteCosts = field(default_factory=RouteCosts)
    waver_probability: float = 0.06
    waver_cost: float = 2.5
    wait_probability: float = 0.25
    blocked_radius_m: float = 0.6
    look_ahead_s: float = 0.6
    longest_wait: int = 2
    goes_with_flow: bool = True
    reaction_delay_s: float = 0.0


class ScriptedExpert:
    """Decides as a person would; seeded, and the same again for the same episode."""

    name = "scripted_expert"

    def __init__(
        self, scenario: Scenario, seed: int, settings: ExpertSettings | None = None
    ) -> None:
        self._seed = seed
        self._settings = settings if settings is not None else ExpertSettings()
        self._grid = grid_of(scenario)
        flow = flow_of(scenario, self._grid)
        self._flow = flow if self._settings.goes_with_flow else opposite_flow(flow)
        self._goal = goal_states_of(scenario, self._grid)
        self.begin(0)

    def begin(self, episode: int) -> None:
        """Draw this episode's likes and dislikes."""
        self._rng = episode_rng(self._seed, episode, EXPERT)
        costs = self._settings.costs
        self._move_cost = move_costs(self._grid, self._flow, costs, self._rng)
        self._to_go = costs_to_go(self._grid, self._move_cost, self._goal, costs.turning)
        self._last_move = Action.WAIT
        self._waited = 0

    def decide(self, observation: Observation, state: int) -> Action:
        """Next move towards the goal, or WAIT."""
        wavers, waits = self._rng.random(2) < (
            self._settings.waver_probability,
            self._settings.wait_probability,
        )
        if state < 0 or state in self._goal:
            return Action.WAIT
        move = self._choose(self._total_costs(state), bool(wavers))
        patient = self._waited < self._settings.longest_wait
        if waits and patient and self._is_blocked(observation, state, move):
            self._waited += 1
            return Action.WAIT
        self._waited, self._last_move = 0, move
        return move

    def _total_costs(self, state: int) -> FloatArray:
        """(5,) cost of each action plus the way from where it leads."""
        following = self._to_go[self._grid.neighbours[state], np.arange(len(Action))]
        turned = np.array([act not in (Action.WAIT, self._last_move) for act in Action])
        turning = self._settings.costs.turning * turned * (self._last_move != Action.WAIT)
        total: FloatArray = self._move_cost[state] + following + turning
        return total

    def _choose(self, total: FloatArray, wavers: bool) -> Action:
        best = int(np.argmin(total))
        near = [act for act in MOVES if total[act] <= total[best] + self._settings.waver_cost]
        if wavers and len(near) > 1:
            return Action(int(self._rng.choice(near)))
        return Action(best)

    def _is_blocked(self, observation: Observation, state: int, move: Action) -> bool:
        center = self._grid.centers_m[state] + self._grid.cell_size_m * DIRECTION_VECTORS[move]
        seen_s = -self._settings.reaction_delay_s
        for share in (0.0, 0.5, 1.0):
            at_s = seen_s + share * self._settings.look_ahead_s
            place = observation.people_position_m + at_s * observation.people_velocity_mps
            away = place - center
            if (np.hypot(away[:, 0], away[:, 1]) < self._settings.blocked_radius_m).any():
                return True
        return False


STYLES: dict[str, ExpertSettings] = {
    "steady": ExpertSettings(
        costs=RouteCosts(lane_dislike=0.2),
        waver_probability=0.03,
        wait_probability=0.15,
        reaction_delay_s=0.2,
    ),
    "hasty": ExpertSettings(
        costs=RouteCosts(against_flow=2.5, across_flow=0.2, turning=0.2),
        waver_probability=0.08,
        wait_probability=0.05,
        reaction_delay_s=0.15,
    ),
    "cautious": ExpertSettings(
        costs=RouteCosts(against_flow=6.0, across_flow=0.8),
        waver_probability=0.05,
        wait_probability=0.6,
        blocked_radius_m=0.7,
        look_ahead_s=0.8,
        longest_wait=3,
        reaction_delay_s=0.3,
    ),
    "wavering": ExpertSettings(
        costs=RouteCosts(lane_dislike=0.6),
        waver_probability=0.15,
        waver_cost=3.0,
        reaction_delay_s=0.4,
    ),
}


class VariedExpert:
    """Another style in each episode, drawn by the episode's number; style: the present one."""

    name = "varied_expert"

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self._seed = seed
        self._experts = {
            style: ScriptedExpert(scenario, seed, settings) for style, settings in STYLES.items()
        }
        self.begin(0)

    def begin(self, episode: int) -> None:
        """Draw the style, then this episode's likes and dislikes."""
        drawn = episode_rng(self._seed, episode, EXPERT, 1).integers(len(self._experts))
        self.style = tuple(self._experts)[int(drawn)]
        self._experts[self.style].begin(episode)

    def decide(self, observation: Observation, state: int) -> Action:
        """As the expert of this episode decides."""
        return self._experts[self.style].decide(observation, state)


def move_costs(
    grid: Grid, flow: IntArray, costs: RouteCosts, rng: np.random.Generator
) -> FloatArray:
    """(S, 5) cost of each move this time, inf where blocked or WAIT.

    The dislike of lanes is drawn once for every row and column of cells, so that people choose a
    lane and keep to it.
    """
    vectors = DIRECTION_VECTORS.astype(np.float64)
    flow_vector = np.where(flow[:, None] >= 0, vectors[np.maximum(flow, 0)], 0.0)
    along = flow_vector @ vectors.T
    has_flow = (flow >= 0)[:, None]
    cost = 1.0 + costs.against_flow * (along < 0) + costs.across_flow * (has_flow & (along == 0))
    dislike = costs.lane_dislike * rng.exponential(size=sum(grid.walkable.shape))
    row_dislike, column_dislike = np.split(dislike, [grid.walkable.shape[0]])
    cost = cost + np.where(
        vectors[None, :, 0] != 0,
        row_dislike[grid.cells[:, 0], None],
        column_dislike[grid.cells[:, 1], None],
    )
    blocked = grid.neighbours == np.arange(grid.n_states)[:, None]
    return np.where(blocked, np.inf, cost)


def opposite_flow(flow: IntArray) -> IntArray:
    """(S,) the flow turned round; cells without flow stay without."""
    return np.where(flow > 0, (flow + 1) % 4 + 1, flow)


def costs_to_go(
    grid: Grid, cost: FloatArray, goal_states: IntArray, turning_cost: float
) -> FloatArray:
    """(S, 5) cheapest cost to the goal from each state, having moved by each action last.

    Column WAIT: no direction yet, so that the first move turns for nothing.
    """
    state, move = np.nonzero(np.isfinite(cost))
    last = np.arange(len(Action))[:, None]
    turned = (last != Action.WAIT) & (last != move)
    steps = cost[state, move] + turning_cost * turned
    starts, ends = np.broadcast_arrays(
        state * len(Action) + last, grid.neighbours[state, move] * len(Action) + move
    )
    backwards = ends.ravel(), starts.ravel()
    size = grid.n_states * len(Action)
    graph = scipy.sparse.csr_matrix((steps.ravel(), backwards), shape=(size, size))
    goals = (goal_states[:, None] * len(Action) + np.arange(len(Action))).ravel()
    to_go = scipy.sparse.csgraph.dijkstra(graph, indices=goals, min_only=True)
    return np.asarray(to_go.reshape(-1, len(Action)), dtype=np.float64)


#: Ends of the name of a driver that is a model file.
MODEL_SUFFIXES = (".yaml", ".yml")


class Driver(Protocol):
    """Chooses an action per decision epoch: a scripted person or a learned policy."""

    @property
    def name(self) -> str:
        """Name for tables."""

    def begin(self, episode: int) -> None:
        """A new episode starts; random choices depend on its number only."""

    def decide(self, observation: Observation, state: int, /) -> Action:
        """The action of the decision epoch that begins now, in a cell; state: -1 off the grid."""


#: An expert that never wavers or waits, so that only the planner is measured.
_RESOLUTE = ExpertSettings(waver_probability=0.0, wait_probability=0.0)
_AGAINST_FLOW = replace(_RESOLUTE, goes_with_flow=False)
_DRIVERS: dict[str, Callable[[Scenario, int], Driver]] = {
    "expert": ScriptedExpert,
    "expert_with_flow": partial(ScriptedExpert, settings=_RESOLUTE),
    "expert_against_flow": partial(ScriptedExpert, settings=_AGAINST_FLOW),
    "varied_expert": VariedExpert,
    **{f"{name}_expert": partial(ScriptedExpert, settings=each) for name, each in STYLES.items()},
}


def driver_names() -> tuple[str, ...]:
    """Names that `make_driver` accepts."""
    return tuple(_DRIVERS)


def make_driver(name: str, scenario: Scenario, seed: int) -> Driver:
    """The driver of that name or model file; SimError with the nearest name when there is none."""
    if name.endswith(MODEL_SUFFIXES):
        # Here, for the names alone need no Bellman solver.
        from serd_sim.drivers.policy_driver import model_driver

        return model_driver(name, scenario, seed)
    if name not in _DRIVERS:
        names = choice_rule("driver", name, _DRIVERS)
        raise SimError(f"{names}; or name the .yaml file of a model")
    return _DRIVERS[name](scenario, seed)
