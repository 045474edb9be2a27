"""The strategy at work, without ROS: plans, decides, looks ahead, gives up, predicts its arrival.

One object for the node, for `serd navigate` and for tests. Goal and model may change at any time,
also in the middle of an episode; what cannot be used is refused by an error and changes nothing.
"""

from dataclasses import dataclass

import numpy as np

from serd_app.navigation.give_up import GiveUp, GiveUpRules, Patience
from serd_app.navigation.lookahead import cell_ahead, likeliest_next
from serd_app.navigation.settings import NavigationSettings
from serd_app.navigation.strategy import Strategy, load_strategy
from serd_core.arrays import FloatArray
from serd_core.arrival.law import ArrivalLaw
from serd_core.grid.grid import Action
from sim.drivers.policy_driver import PolicyDriver
from sim.scenario.goal import goal_at, with_goal
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint, waypoint_of_cell, waypoint_of_intent
from storage.model_file import ModelFile, load_model

#: Marks of a prediction that people read: half and nine in ten have arrived.
HALF, MOST = 0.5, 0.9


@dataclass(frozen=True, eq=False)
class Outlook:
    """What a decision was made on. law: remaining seconds; state: -1 off the grid.

    probability: of arriving before the time-out. trapped: whether the state is a trap.
    """

    time_s: float
    elapsed_s: float
    state: int
    action: Action
    law: ArrivalLaw
    probability: float
    trapped: bool
    periods_without_progress: int


class Navigator:
    """Drives by the policy of a model file; fits the `Driver` protocol."""

    def __init__(self, scenario: Scenario, config: NavigationSettings) -> None:
        self._config = config
        self._own_scenario = scenario
        self._model = config.model
        self._patience = Patience(
            GiveUpRules(config.patience_periods, config.minimum_arrival_probability)
        )
        self.strategy = self._solved(config.model, with_goal(scenario, config.goal))
        self._driver = PolicyDriver(
            self.strategy.problem.grid,
            self.strategy.policy.probabilities,
            seed=config.seed,
            greedy=config.policy == "optimal",
            name="strategy",
        )
        self._ahead = likeliest_next(self.strategy)
        self._started_s: float | None = None
        self.gave_up: GiveUp | None = None
        self.outlook: Outlook | None = None

    @property
    def name(self) -> str:
        """Name for tables."""
        return self._driver.name

    @property
    def model(self) -> str:
        """Path or name of the model in force."""
        return self._model

    def begin(self, episode: int) -> None:
        """A new episode starts; goal and model stay."""
        self._driver.begin(episode)
        self._patience.renew()
        self._started_s, self.gave_up, self.outlook = None, None, None

    def decide(self, observation: Observation) -> Action:
        """The policy's action, WAIT off the grid; `outlook` and `gave_up` go with it."""
        if self._started_s is None:
            self._started_s = observation.time_s
        action = self._driver.decide(observation)
        state = self._state(observation)
        elapsed_s = observation.time_s - self._started_s
        left = self._periods_left(elapsed_s)
        self.gave_up = self._patience.see(self.strategy.arrival, state, left)
        self.outlook = Outlook(
            time_s=observation.time_s,
            elapsed_s=elapsed_s,
            state=state,
            action=action,
            law=self._law(state),
            probability=float(self.strategy.arrival.within(left)[state]) if state >= 0 else 0.0,
            trapped=state >= 0 and state in self.strategy.traps,
            periods_without_progress=self._patience.periods_without_progress,
        )
        return action

    def waypoint_of(self, observation: Observation, action: Action) -> Waypoint:
        """Where an action sends the robot: the next cell, or farther by `lookahead_cells`."""
        grid, state = self.strategy.problem.grid, self._state(observation)
        if action == Action.WAIT or state < 0:
            return waypoint_of_intent(grid, observation, action)
        n_cells = self._config.lookahead_cells
        return waypoint_of_cell(
            grid, cell_ahead(self.strategy, self._ahead, state, action, n_cells)
        )

    def set_goal(self, x_m: float, y_m: float) -> None:
        """Plan for the cell under a point; SimError where there is none."""
        self._plan_for(goal_at(self.strategy.scenario, x_m, y_m))

    def set_goal_text(self, text: str) -> None:
        """Plan for "x, y" (m), or for the scenario's own goal area when empty."""
        self._plan_for(with_goal(self._own_scenario, text))

    def set_model(self, path: str) -> None:
        """Plan by another model file, or by the same one read again; FileError if unusable."""
        self.use_model(load_model(path), path)

    def use_model(self, file: ModelFile, name: str) -> None:
        """Plan by a model under a name for tables; an equal one changes nothing else."""
        if file != self.strategy.file:
            self._replace(self._solved(name, self.strategy.scenario, file))
        self._model = name

    def way_m(self, observation: Observation) -> FloatArray:
        """(N, 2) the way the policy means to go from here."""
        state = self._state(observation)
        return self.strategy.intended_path_m(state) if state >= 0 else np.zeros((0, 2))

    def _plan_for(self, scenario: Scenario) -> None:
        """Plan by the model in force, whatever has become of its file."""
        self._replace(self._solved(self._model, scenario, self.strategy.file))

    def _solved(self, path: str, scenario: Scenario, read: ModelFile | None = None) -> Strategy:
        config = self._config
        return load_strategy(
            path,
            scenario,
            config.policy,
            transfer=config.transfer,
            timeout_s=config.timeout_s,
            read=read,
        )

    def _replace(self, strategy: Strategy) -> None:
        self.strategy = strategy
        self._ahead = likeliest_next(strategy)
        self._driver.follow(strategy.policy.probabilities)
        self._patience.renew()

    def _law(self, state: int) -> ArrivalLaw:
        """Remaining seconds from a state; never arriving, off the grid."""
        if state < 0:
            return ArrivalLaw(np.zeros(1), np.zeros(1), 0.0)
        return self.strategy.law_s(self.strategy.arrival.from_state(state))

    def _periods_left(self, elapsed_s: float) -> int:
        period_s = self.strategy.scenario.decision_period_s
        return self.strategy.n_periods - round(elapsed_s / period_s)

    def _state(self, observation: Observation) -> int:
        return self.strategy.problem.grid.state_at(observation.x_m, observation.y_m)
