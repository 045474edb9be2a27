"""One episode: a driver decides, the planner drives, the world answers, until the goal or timeout.

The order within a control period is that of the ROS graph: observe, decide when a decision epoch
begins, plan towards the waypoint, guard the command, step the world.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action
from serd_files.settings import setting
from serd_files.table import EpisodeResult
from serd_files.yaml_config import StrictModel
from serd_sim.drivers.catalogue import Driver
from serd_sim.errors import SimError
from serd_sim.perception.scanning_planner import ScanningPlanner
from serd_sim.planning.local_planner import LocalPlanner
from serd_sim.robot.robot import ContactCounts
from serd_sim.safety.world_guard import CommandFilter, WorldGuard
from serd_sim.scenario.grid import Area, is_at_goal
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command
from serd_sim.world.epochs import decisions_of, epochs_in
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint, waypoint_of_intent

if TYPE_CHECKING:  # which needs PyBullet; nodes on a robot use what this module defines
    from serd_sim.world.world import HallwayWorld


Ending = Literal["arrived", "timeout", "aborted"]
Observer = Callable[[Observation, Command, Action], bool | None]


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """What came of one episode. time_of_arrival_s: since its start, NaN when it did not arrive."""

    episode: int
    seed: int
    driver: str
    start_area: str
    outcome: Ending
    time_of_arrival_s: float
    duration_s: float
    n_ticks: int
    distance_m: float
    contacts: ContactCounts
    minimum_person_distance_m: float
    decisions: TimedDecisions


class EpisodeProgress:
    """Follows one episode from its first observation on. timeout_s: simulated seconds.

    goal_area_m: may be set to another area, for the following observations.
    """

    def __init__(self, scenario: Scenario, start: Observation, timeout_s: float) -> None:
        self.start = start
        self.distance_m = 0.0
        self._last = start
        self._scenario, self._period_s = scenario, scenario.control_period_s
        self.goal_area_m: Area = scenario.goal_area_m
        self._n_ticks = round(timeout_s / scenario.control_period_s)

    def see(self, observation: Observation) -> Ending | None:
        """Take the next observation; returns how the episode ends with it, None when it goes on."""
        before, self._last = self._last, observation
        self.distance_m += math.hypot(observation.x_m - before.x_m, observation.y_m - before.y_m)
        if is_at_goal(self._scenario, self.goal_area_m, observation.x_m, observation.y_m):
            return "arrived"
        return "timeout" if self.n_ticks >= self._n_ticks else None

    @property
    def n_ticks(self) -> int:
        """Control periods since the start."""
        return self._last.tick - self.start.tick

    @property
    def duration_s(self) -> float:
        """Simulated seconds since the start."""
        return self.n_ticks * self._period_s


def run_episode(
    world: "HallwayWorld",
    planner: LocalPlanner,
    driver: Driver,
    *,
    episode: int,
    start_area: str = "train",
    timeout_s: float | None = None,
    observer: Observer | None = None,
    guard: CommandFilter | None = None,
) -> EpisodeRecord:
    """Run one episode to its end; an observer that returns False aborts it.

    timeout_s: simulated seconds, the scenario's when None. guard: from the planner's command to the
    one that reaches the robot and the observer; a guard of the world that relies on the people that
    the planner relies on when None.
    """
    limit_s = world.scenario.episode_timeout_s if timeout_s is None else timeout_s
    if guard is None:
        guard = WorldGuard(world, "scan" if isinstance(planner, ScanningPlanner) else "given")
    observation = world.reset(episode, start_area)
    planner.reset()
    driver.begin(episode)
    epochs = epochs_in(world.scenario)
    progress = EpisodeProgress(world.scenario, observation, limit_s)
    waypoint: Waypoint | None = None
    outcome: Ending | None = None
    while outcome is None:
        if epochs.begins(observation):
            epochs.take(observation.time_s, _action(driver, observation, epochs.state))
            waypoint = waypoint_of_intent(world.scenario.cells, observation, epochs.action)
        wanted = planner.step(observation, waypoint)
        if not isinstance(wanted, Command):
            raise SimError(
                f"step of {type(planner).__name__} must return a Command, got {wanted!r}"
                "; return STOP to stand"
            )
        command = guard(observation, wanted)
        if observer is not None and observer(observation, command, epochs.action) is False:
            outcome = "aborted"
        else:
            observation = world.step(command)
            outcome = progress.see(observation)
    if outcome != "aborted":
        epochs.end(
            observation.time_s, observation.x_m, observation.y_m, arrived=outcome == "arrived"
        )
    return EpisodeRecord(
        episode=episode,
        seed=world.seed,
        driver=driver.name,
        start_area=start_area,
        outcome=outcome,
        time_of_arrival_s=progress.duration_s if outcome == "arrived" else float("nan"),
        duration_s=progress.duration_s,
        n_ticks=progress.n_ticks,
        distance_m=progress.distance_m,
        contacts=world.contacts,
        minimum_person_distance_m=world.minimum_person_distance_m,
        decisions=decisions_of(
            {episode: epochs.ended}, f"{driver.name} in {world.scenario.name}, seed {world.seed}"
        ),
    )


def _action(driver: Driver, observation: Observation, state: int) -> Action:
    """What a driver decides; SimError where it is no action."""
    chosen: object = driver.decide(observation, state)
    try:
        return Action(chosen)  # type: ignore[arg-type]  # of whatever a user's driver returns
    except ValueError:
        names = ", ".join(f"{each.value} ({each.name})" for each in Action)
        raise SimError(
            f"decide of {type(driver).__name__} must return an Action, one of {names}, got"
            f" {chosen!r}; return Action.WAIT to stand"
        ) from None


#: What a record and a row both have.
_OF_RECORD = {each.name for each in fields(EpisodeResult)} & {
    each.name for each in fields(EpisodeRecord)
}
#: Start area of an episode that began without a reset.
ANYWHERE = "anywhere"


class EpisodeStart(StrictModel):
    """An episode that begins now; observations before start_s belong to the one before.

    The service `reset` responds with it as JSON.
    """

    episode: int = Field(ge=0)
    seed: int = Field(ge=0)
    start_area: str
    start_s: float


def observed_result(
    start: EpisodeStart,
    progress: EpisodeProgress,
    report: Mapping[str, str],
    *,
    driver: str,
    outcome: Ending,
    reason: str,
    wall_s: float,
) -> EpisodeResult:
    """The row of an episode over ROS; report: values of `hallway_sim` on `diagnostics`, as text."""
    duration_s = progress.duration_s
    contacts: dict[str, Any] = {each.name: int(report[each.name]) for each in fields(ContactCounts)}
    return EpisodeResult(
        **start.model_dump(exclude={"start_s"}),
        driver=driver,
        outcome=outcome,
        time_of_arrival_s=duration_s if outcome == "arrived" else math.nan,
        duration_s=duration_s,
        distance_m=progress.distance_m,
        **contacts,
        minimum_person_distance_m=float(report["minimum_person_distance_m"]),
        wall_s=wall_s,
        reason=reason,
    )


def result_of_record(record: EpisodeRecord, *, reason: str, wall_s: float) -> EpisodeResult:
    """The row of an episode that was run in process; reason: why the driver gave up, or empty."""
    return EpisodeResult(
        **{name: getattr(record, name) for name in _OF_RECORD},
        **asdict(record.contacts),
        wall_s=wall_s,
        reason="" if record.outcome == "arrived" else reason,
    )


class EpisodeSettings(StrictModel):
    """One series of episodes in a scenario."""

    scenario: str = setting(
        "hallway", "built-in scenario or path of a scenario YAML file", min_length=1
    )
    seed: int = setting(0, "seed of people, starts and random choices", ge=0)
    episodes: int = setting(20, "number of episodes to drive", ge=1)
    timeout_s: float = setting(
        Scenario.model_fields["episode_timeout_s"].default,
        "simulated time per episode",
        unit="s",
        ge=2,
        le=86400,
    )


class WorldSettings(StrictModel):
    """What surrounds the driver of an episode."""

    start_area: str = setting("train", "start area of the scenario in which episodes begin")
    people: int | None = setting(None, "number of people; as the scenario has it by default", ge=0)
