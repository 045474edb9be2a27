"""Drives by a learned model without ROS: plans, decides, forecasts its arrival, gives up.

One object for the node, for `serd navigate` and for tests. Goal and model may change at any time,
also in the middle of an episode; an unusable one raises an error and changes nothing.
"""

from enum import Enum

import numpy as np

from serd_app.navigation.forecast import ArrivalForecast
from serd_app.navigation.settings import NavigationSettings
from serd_core.arrays import FloatArray
from serd_core.arrival.chain import ArrivalByState
from serd_core.arrival.law import ArrivalLaw
from serd_core.grid.grid import Action
from serd_files.model_file import ModelFile, load_model
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.drivers.strategy import STEP_S, Strategy, load_strategy
from serd_sim.scenario.goal import goal_at, with_goal
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation


class GiveUp(Enum):
    """Why the strategy gives up a drive, as it stands in marks and tables."""

    NO_PROGRESS = "no progress"
    UNLIKELY = "arrival unlikely"


class ProgressMonitor:
    """Follows one drive by the rules of the settings, decision by decision.

    Progress is a new minimum of the mean remaining time: a robot that waits, is carried back or
    goes in circles makes none. The probability is that of arriving in the time that is left. The
    time-out is not counted here.
    """

    def __init__(self, settings: NavigationSettings) -> None:
        self._patience_decisions = settings.patience_decisions
        self._minimum_probability = settings.minimum_arrival_probability
        self.reset()

    def reset(self) -> None:
        """Start again: the drive, its goal or its model changed."""
        self.decisions_without_progress = 0
        self._minimum_mean = float("inf")

    def update(self, arrival: ArrivalByState, state: int, n_steps_left: int) -> GiveUp | None:
        """The reason to give up at the next decision; None to go on. state: -1 off the grid."""
        mean = float(arrival.mean_steps[state]) if state >= 0 else float("inf")
        if mean < self._minimum_mean:
            self._minimum_mean, self.decisions_without_progress = mean, 0
        else:
            self.decisions_without_progress += 1
        if 0 < self._patience_decisions <= self.decisions_without_progress:
            return GiveUp.NO_PROGRESS
        if state < 0:
            return None
        unlikely = float(arrival.within(n_steps_left)[state]) < self._minimum_probability
        return GiveUp.UNLIKELY if unlikely else None


class Navigator:
    """Drives by the policy of a model file; fits the `Driver` protocol.

    model: path or name of the one in use. forecast: that of the last decision. gave_up: the reason
    to give the episode up, None to go on.
    """

    def __init__(self, scenario: Scenario, settings: NavigationSettings) -> None:
        self._settings, self._own_scenario = settings, scenario
        self.name, self.model = "strategy", settings.model
        self._monitor = ProgressMonitor(settings)
        self.strategy = self._solved(settings.model, with_goal(scenario, settings.goal))
        self._driver = PolicyDriver(
            self.strategy.problem.grid,
            self.strategy.policy.probabilities,
            seed=settings.seed,
            greedy=settings.policy == "optimal",
            name=self.name,
        )
        self._started_s: float | None = None
        self.gave_up: GiveUp | None = None
        self.forecast: ArrivalForecast | None = None

    @property
    def reason(self) -> str:
        """Why the episode is given up; empty to go on."""
        return self.gave_up.value if self.gave_up is not None else ""

    def begin(self, episode: int) -> None:
        """Begin an episode; goal and model stay."""
        self._driver.begin(episode)
        self._monitor.reset()
        self._started_s, self.gave_up, self.forecast = None, None, None

    def decide(self, observation: Observation, state: int) -> Action:
        """The action of the policy in a cell, WAIT off the grid; sets `forecast`, `gave_up`."""
        if self._started_s is None:
            self._started_s = observation.time_s
        action = self._driver.decide(observation, state)
        elapsed_s = observation.time_s - self._started_s
        left = self.strategy.n_steps - round(elapsed_s / STEP_S)
        self.gave_up = self._monitor.update(self.strategy.arrival, state, left)
        self.forecast = ArrivalForecast(
            time_s=observation.time_s,
            elapsed_s=elapsed_s,
            state=state,
            action=action,
            law=self._law(state),
            probability=float(self.strategy.arrival.within(left)[state]) if state >= 0 else 0.0,
            trapped=state >= 0 and state in self.strategy.traps,
            decisions_without_progress=self._monitor.decisions_without_progress,
            by_time=state >= 0 and bool(self.strategy.by_time[state]),
        )
        return action

    def set_goal(self, x_m: float, y_m: float) -> None:
        """Plan for the cell at a point; SimError where there is none."""
        self._plan_for(goal_at(self.strategy.scenario, x_m, y_m))

    def set_goal_text(self, text: str) -> None:
        """Plan for "x, y" (m), or for the scenario's own goal area when empty."""
        self._plan_for(with_goal(self._own_scenario, text))

    def set_model(self, path: str) -> None:
        """Plan by another model file, or by the same one read again; FileError if unusable."""
        self.use_model(load_model(path), path)

    def use_model(self, file: ModelFile, name: str) -> None:
        """Plan by a model under a name for tables; an equal model changes the name only."""
        if file != self.strategy.file:
            self._replace(self._solved(name, self.strategy.scenario, file))
        self.model = name

    def way_m(self, observation: Observation) -> FloatArray:
        """(N, 2) the way of the greedy policy from here."""
        state = self._state(observation)
        return self.strategy.intended_path_m(state) if state >= 0 else np.zeros((0, 2))

    def _plan_for(self, scenario: Scenario) -> None:
        """Plan by the model in use, whatever its file holds now."""
        self._replace(self._solved(self.model, scenario, self.strategy.file))

    def _solved(self, path: str, scenario: Scenario, file: ModelFile | None = None) -> Strategy:
        return load_strategy(
            path,
            scenario,
            self._settings.policy,
            transfer=self._settings.transfer,
            timeout_s=self._settings.timeout_s,
            file=file,
        )

    def _replace(self, strategy: Strategy) -> None:
        self.strategy = strategy
        self._driver.follow(strategy.policy.probabilities)
        self._monitor.reset()

    def _law(self, state: int) -> ArrivalLaw:
        """Remaining seconds from a state; off the grid it never arrives."""
        if state < 0:
            return ArrivalLaw(np.zeros(1), np.zeros(1), 0.0)
        return self.strategy.law_of_cell(state)

    def _state(self, observation: Observation) -> int:
        return self.strategy.problem.grid.state_at(observation.x_m, observation.y_m)
