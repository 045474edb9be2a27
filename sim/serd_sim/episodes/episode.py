"""One episode: a driver decides, the planner drives, the world answers, until the goal or timeout.

The order within a control period is that of the ROS graph: observe, decide when a decision epoch
begins, plan towards the waypoint, guard the command, step the world.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action
from serd_sim.drivers.catalogue import Driver
from serd_sim.errors import SimError
from serd_sim.perception.scanning_planner import ScanningPlanner
from serd_sim.planning.local_planner import LocalPlanner
from serd_sim.robot.contacts import ContactCounts
from serd_sim.safety.world_guard import CommandFilter, WorldGuard
from serd_sim.scenario.goal import Area
from serd_sim.scenario.polygon import contains_point
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
        self._period_s = scenario.control_period_s
        self.goal_area_m: Area = scenario.goal_area_m
        self._n_ticks = round(timeout_s / scenario.control_period_s)

    def see(self, observation: Observation) -> Ending | None:
        """Take the next observation; returns how the episode ends with it, None when it goes on."""
        before, self._last = self._last, observation
        self.distance_m += math.hypot(observation.x_m - before.x_m, observation.y_m - before.y_m)
        if contains_point(self.goal_area_m, observation.x_m, observation.y_m):
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
    epochs = epochs_in(world.scenario, world.grid)
    progress = EpisodeProgress(world.scenario, observation, limit_s)
    waypoint: Waypoint | None = None
    outcome: Ending | None = None
    while outcome is None:
        if epochs.begins(observation):
            epochs.take(observation.time_s, _action(driver, observation, epochs.state))
            waypoint = waypoint_of_intent(world.grid, observation, epochs.action)
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
