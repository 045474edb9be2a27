"""Drives by a learned model without ROS: plans, decides, forecasts its arrival, gives up.

One object for the node, for `serd navigate` and for tests. Goal and model may change at any time,
also in the middle of an episode; an unusable one raises an error and changes nothing.

Predicted and measured arrivals are one CSV row per episode, appended as they come. Each row is one
synced write, so that a killed process leaves whole rows.
"""

import math
from dataclasses import astuple, dataclass, replace
from enum import Enum
from pathlib import Path

import numpy as np

from serd_app.navigation.settings import DriveSettings, NavigationSettings
from serd_core.arrays import FloatArray
from serd_core.arrival.arriving_policy import TRAP_PROBABILITY
from serd_core.arrival.chain import ArrivalByState
from serd_core.arrival.law import ArrivalLaw
from serd_core.grid.grid import Action
from serd_files.model_file import ModelFile, load_model
from serd_files.table import EpisodeResult, OptionalFloat, append_row, columns_of
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.drivers.strategy import STEP_S, Strategy, load_strategy
from serd_sim.errors import SimError
from serd_sim.scenario.cells import groups_of
from serd_sim.scenario.grid import goal_at, goal_cell, grid_of, with_goal
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

#: Shares of drives whose times of arrival are reported: half, and nine in ten.
HALF, MOST = 0.5, 0.9


@dataclass(frozen=True, eq=False)
class ArrivalForecast:
    """Made at a decision. law: remaining seconds; state: -1 off the grid.

    probability: of arriving before the time-out. trapped: whether the state is a trap; by_time:
    whether the way of least expected time is taken there, as the learned policy does not arrive.
    """

    time_s: float
    elapsed_s: float
    state: int
    action: Action
    law: ArrivalLaw
    probability: float
    trapped: bool
    decisions_without_progress: int
    by_time: bool = False

    @property
    def summary(self) -> str:
        """One line for a picture."""
        median_s = self.law.quantile_s(HALF)
        arrives = "no arrival expected" if median_s is None else f"arrives in {median_s:.0f} s"
        way = ", TRAPPED" if self.trapped else ", by the way of least expected time" * self.by_time
        return f"{arrives}, before the time-out with {self.probability:.0%}{way}"

    @property
    def needs_attention(self) -> bool:
        """Whether the robot is off the grid, in a trap, or where the learned policy is in one."""
        return self.state < 0 or self.trapped or self.by_time

    @property
    def situation(self) -> str:
        """What the robot does."""
        if self.state < 0:
            return "waiting: off the grid"
        if self.trapped:
            return "in a trap"
        if self.by_time:
            return (
                "driving the way of least expected time, as the learned policy does not arrive from"
                " here"
            )
        return "waiting: action of the policy" if self.action == Action.WAIT else "driving"


def quantile_or_nan_s(law: ArrivalLaw, share: float) -> float:
    """When a share of all drives has arrived; NaN where fewer ever do."""
    time_s = law.quantile_s(share)
    return math.nan if time_s is None else time_s


def plan_remarks(strategy: Strategy) -> list[str]:
    """What somebody who lets the strategy drive must know of its plan, one sentence each."""
    used = strategy.problem.feature_names
    found = [
        f"the data do not support the model: {check.sentence}"
        for check in strategy.file.checks
        if check.mark == "fails" and not strategy.transferred
    ]
    if unused := [name for name in strategy.file.feature_names if name not in used]:
        found.append(
            f"the model's weight of {', '.join(unused)} is not used, as what it weighs is not known"
            " here, or was not where it was learned"
        )
    if strategy.by_time.any():
        learned = strategy.driven.learned_traps
        found.append(
            f"the learned policy does not arrive from {len(learned.states)} of"
            f" {len(learned.looping)} cells: from {int(learned.looping.sum())} its actions never"
            f" lead to the goal, from {int(learned.unlikely.sum())} it is reached before the"
            f" time-out with less than {TRAP_PROBABILITY:.0%}; in {int(strategy.by_time.sum())}"
            " cells the way of least expected time is taken instead"
        )
    if len(traps := strategy.traps.states):
        looping, unlikely = strategy.traps.looping, int(strategy.traps.unlikely.sum())
        found.append(
            f"{len(traps)} of {len(looping)} cells are traps: from {int(looping.sum())} no policy"
            f" leads to the goal, from {unlikely} it is reached before the time-out with less than"
            f" {TRAP_PROBABILITY:.0%}"
        )
    return found


#: Off the grid a robot never arrives.
_NEVER = ArrivalLaw(np.zeros(1), np.zeros(1), 0.0)


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
        self.settings = settings
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
        if 0 < self.settings.patience_decisions <= self.decisions_without_progress:
            return GiveUp.NO_PROGRESS
        if state < 0:
            return None
        probability = float(arrival.within(n_steps_left)[state])
        unlikely = probability < self.settings.minimum_arrival_probability
        return GiveUp.UNLIKELY if unlikely else None


@dataclass(frozen=True, eq=False)
class Wanted:
    """What to plan for: the place with its goal, and the model with its name for tables.

    file: None until there is a model.
    """

    scenario: Scenario
    file: ModelFile | None
    name: str


class Navigator:
    """Drives by the policy of a model, once `use` has a plan; fits the `Driver` protocol.

    forecast: that of the last decision. gave_up: the reason
    to give the episode up, None to go on. waits_for_law: whether decisions before the law of
    arrival is known (`Strategy.has_law`) have no forecast until `complete_forecast`; else they
    compute it.
    """

    def __init__(
        self, scenario: Scenario, settings: NavigationSettings, *, waits_for_law: bool = False
    ) -> None:
        self.settings = settings
        self.name, self.waits_for_law = "strategy", waits_for_law
        #: What the plan is for, and what is to be planned for next.
        self._used = self.wanted = Wanted(with_goal(scenario, settings.goal), None, settings.model)
        self._monitor = ProgressMonitor(settings)
        self._strategy: Strategy | None = None
        grid = grid_of(scenario)
        self._driver = PolicyDriver(
            grid,
            np.full((grid.n_states, len(Action)), 1 / len(Action)),
            seed=settings.seed,
            greedy=settings.policy == "optimal",
            name=self.name,
        )
        self._started_s: float | None = None
        self._decision: tuple[float, int, Action] | None = None
        self.gave_up: GiveUp | None = None
        self.forecast: ArrivalForecast | None = None

    @property
    def model(self) -> str:
        """Path or name of the model in use."""
        return self._used.name

    @property
    def has_plan(self) -> bool:
        """Whether there was a model to plan by."""
        return self._strategy is not None

    @property
    def strategy(self) -> Strategy:
        """The plan; SimError where there is none yet."""
        if self._strategy is None:
            raise SimError(f"there is no plan, as no model has come; learn {self.wanted.name}")
        return self._strategy

    def change(self, settings: NavigationSettings) -> None:
        """Give up by other settings from now on; nothing else is taken from them."""
        self.settings = self._monitor.settings = settings

    @property
    def reason(self) -> str:
        """Why the episode is given up; empty to go on."""
        return self.gave_up.value if self.gave_up is not None else ""

    def begin(self, episode: int) -> None:
        """Begin an episode; goal and model stay."""
        self._driver.begin(episode)
        self._monitor.reset()
        self._started_s, self.gave_up, self.forecast = None, None, None
        self._decision = None

    def decide(self, observation: Observation, state: int) -> Action:
        """The action of the policy in a cell, WAIT off the grid; sets `forecast`, `gave_up`."""
        if self._started_s is None:
            self._started_s = observation.time_s
        action = self._driver.decide(observation, state)
        self._decision = observation.time_s, state, action
        self.forecast = self.gave_up = None
        if self.strategy.has_law or not self.waits_for_law:
            self.complete_forecast()
        return action

    def complete_forecast(self) -> None:
        """Set `forecast` and `gave_up` of the last decision, by the law of arrival."""
        if self._decision is None or self._started_s is None or self.forecast is not None:
            return
        time_s, state, action = self._decision
        elapsed_s = time_s - self._started_s
        left = self.strategy.n_steps - round(elapsed_s / STEP_S)
        self.gave_up = self._monitor.update(self.strategy.arrival, state, left)
        self.forecast = ArrivalForecast(
            time_s=time_s,
            elapsed_s=elapsed_s,
            state=state,
            action=action,
            law=self.strategy.law_of_cell(state) if state >= 0 else _NEVER,
            probability=float(self.strategy.arrival.within(left)[state]) if state >= 0 else 0.0,
            trapped=state >= 0 and state in self.strategy.traps,
            decisions_without_progress=self._monitor.decisions_without_progress,
            by_time=state >= 0 and bool(self.strategy.by_time[state]),
        )

    def check_goal(self, x_m: float, y_m: float, here: Observation | None) -> None:
        """Raise a SimError where no way leads from here to the cell at a point, or there is none.

        here: None where the robot's place is not known; any cell will do then.
        """
        grid = grid_of(self.wanted.scenario)
        goal = goal_cell(grid, x_m, y_m)
        start = -1 if here is None else grid.state_at(here.x_m, here.y_m)
        group = groups_of(grid.walkable)[grid.walkable]
        if here is not None and start >= 0 and group[goal] != group[start]:
            raise SimError(
                f"goal must be in a cell to which a way leads, got ({x_m:g}, {y_m:g}) m, which"
                f" walls part from ({here.x_m:g}, {here.y_m:g}); choose another goal"
            )

    def want_goal(self, x_m: float, y_m: float) -> None:
        """Ask for a plan for the cell at a point; SimError where there is none."""
        self.wanted = replace(self.wanted, scenario=goal_at(self.wanted.scenario, x_m, y_m))

    def want_model(self, file: ModelFile | None, name: str) -> None:
        """Ask for a plan by a model, under a name for tables; None to wait for one."""
        self.wanted = replace(self.wanted, file=file, name=name)

    def plan(self) -> None:
        """Plan for what is wanted and drive by it; FileError where the model is unusable."""
        self.use(self.wanted, self.solve(self.wanted))

    def keep_plan(self) -> None:
        """Ask for nothing but the plan that there is."""
        self.wanted = self._used

    def solve(self, wanted: Wanted) -> Strategy:
        """The plan for what is wanted, in any thread; the present one where that is the same."""
        present, area_m = self._strategy, wanted.scenario.goal_area_m
        if present and (wanted.file, area_m) == (present.file, present.scenario.goal_area_m):
            return present
        strategy = load_strategy(
            wanted.name,
            wanted.scenario,
            self.settings.policy,
            plan_quantile=self.settings.plan_quantile,
            transfer=self.settings.transfer,
            timeout_s=self.settings.timeout_s,
            file=wanted.file,
        )
        _ = strategy.traps  # planned here, not where it is used
        return strategy

    def use(self, wanted: Wanted, strategy: Strategy) -> bool:
        """Drive by a plan from `solve`; returns whether it is another than before."""
        self._used, before = wanted, self._strategy
        if strategy is before:
            return False
        self._strategy = strategy
        self._driver.follow(strategy.policy.probabilities)
        self._monitor.reset()
        return True

    def way_m(self, observation: Observation) -> FloatArray:
        """(N, 2) the way of the greedy policy from here."""
        state = self.strategy.problem.grid.state_at(observation.x_m, observation.y_m)
        return self.strategy.intended_path_m(state) if state >= 0 else np.zeros((0, 2))


def planned_navigator(settings: DriveSettings) -> Navigator:
    """One with the plan by the model of the settings; FileError where it is unusable."""
    navigator = Navigator(settings.place(), settings)
    navigator.want_model(load_model(settings.model), settings.model)
    navigator.plan()
    return navigator


@dataclass(frozen=True)
class ArrivalRow:
    """One drive, its prediction made at its start or at the last change of goal or model.

    outcome: arrived, timeout or aborted; reason: why it was given up, else empty.
    predicted_probability: of arriving in time; predicted_median_s, predicted_most_s: by which half
    and 90 % of such drives arrive, NaN where fewer ever do. time_of_arrival_s: NaN if it did not.
    predicted_share: predicted probability of arriving no later than it did; these are uniform on
    [0, 1] where predictions are right. All times are simulated seconds since the episode's start.
    """

    episode: int
    seed: int
    start_x_m: float
    start_y_m: float
    goal_x_m: float
    goal_y_m: float
    model: str
    outcome: str
    reason: str
    predicted_probability: float
    predicted_median_s: OptionalFloat
    predicted_most_s: OptionalFloat
    time_of_arrival_s: OptionalFloat
    predicted_share: OptionalFloat


@dataclass(frozen=True, eq=False)
class Prediction:
    """Made at the first decision for a goal and a model; law: seconds since the episode began."""

    start_m: tuple[float, float]
    scenario: Scenario
    model: str
    law: ArrivalLaw
    probability: float


class ArrivalRecords:
    """Writes `arrivals.csv` into the folder `output`; nothing when it is None."""

    def __init__(self, output: Path | None) -> None:
        self._path = output / "arrivals.csv" if output is not None else None
        self._prediction: Prediction | None = None

    def discard_prediction(self) -> None:
        """Discard the prediction: goal or model changed."""
        self._prediction = None

    def note_decision(self, navigator: Navigator, observation: Observation) -> None:
        """Keep the forecast of the decision just made, if it is the first of the drive."""
        if self._prediction is None:
            self._prediction = prediction_of(navigator, observation)

    def note_result(self, result: EpisodeResult) -> None:
        """Append the row of a drive that has ended, if there is a prediction of it."""
        prediction, self._prediction = self._prediction, None
        if prediction is not None and self._path is not None:
            append_row(self._path, columns_of(ArrivalRow), astuple(arrival_row(prediction, result)))


def prediction_of(navigator: Navigator, observation: Observation) -> Prediction | None:
    """The prediction of the decision just made, None off the grid."""
    forecast = navigator.forecast
    if forecast is None or forecast.state < 0:
        return None
    return Prediction(
        start_m=(observation.x_m, observation.y_m),
        scenario=navigator.strategy.scenario,
        model=navigator.model,
        law=forecast.law.delayed(forecast.elapsed_s),
        probability=forecast.probability,
    )


def arrival_row(prediction: Prediction, result: EpisodeResult) -> ArrivalRow:
    """The row of a drive that has ended."""
    area, law = prediction.scenario.goal_area_m, prediction.law
    time_s = result.time_of_arrival_s
    return ArrivalRow(
        episode=result.episode,
        seed=result.seed,
        start_x_m=prediction.start_m[0],
        start_y_m=prediction.start_m[1],
        goal_x_m=sum(x for x, _ in area) / len(area),
        goal_y_m=sum(y for _, y in area) / len(area),
        model=prediction.model,
        outcome=result.outcome,
        reason=result.reason,
        predicted_probability=prediction.probability,
        predicted_median_s=quantile_or_nan_s(law, HALF),
        predicted_most_s=quantile_or_nan_s(law, MOST),
        time_of_arrival_s=time_s,
        predicted_share=math.nan if math.isnan(time_s) else float(law.probability_by(time_s)),
    )
