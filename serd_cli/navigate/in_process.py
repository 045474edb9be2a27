"""Episodes of the strategy in process: the same world, planner and navigator as the nodes run."""

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from serd_app.navigation.arrival_log import append_arrival
from serd_app.navigation.navigator import Navigator
from serd_app.navigation.prediction import Prediction, arrival_row, prediction_of
from serd_cli.navigate.settings import NavigateSettings
from serd_core.grid.grid import Action
from sim.episodes.episode import EpisodeRecord, run_episode
from sim.planning.catalogue import make_planner
from sim.world.command import Command
from sim.world.observation import Observation
from sim.world.world import HallwayWorld
from storage.episode_table import EpisodeResult, save_episodes

Told = Callable[[EpisodeResult], None]


def drive_in_process(
    settings: NavigateSettings,
    output: Path | None,
    done: Sequence[EpisodeResult],
    on_episode: Told,
) -> list[EpisodeResult]:
    """Drive the episodes that are not done yet; rows of all of them.

    output: folder that gets each row as it comes, none when None.
    """
    navigator = Navigator(settings.place(), settings)
    scenario = navigator.strategy.scenario
    results = list(done)
    with HallwayWorld(scenario, seed=settings.seed) as world:
        planner = make_planner(settings.planner, scenario)
        for episode in range(len(done), settings.episodes):
            watch = _Watch(navigator)
            began_s = time.monotonic()
            record = run_episode(
                world,
                planner,
                navigator,
                episode=episode,
                start_area=settings.start_area,
                timeout_s=settings.timeout_s,
                observer=watch.see,
                waypoint_of=navigator.waypoint_of,
            )
            results.append(_result(record, watch.reason, time.monotonic() - began_s))
            if output is not None:
                _keep(output, results, watch.prediction)
            on_episode(results[-1])
    return results


class _Watch:
    """Keeps the first prediction of an episode and ends it when the navigator gives up."""

    def __init__(self, navigator: Navigator) -> None:
        self._navigator = navigator
        self.prediction: Prediction | None = None

    @property
    def reason(self) -> str:
        gave_up = self._navigator.gave_up
        return gave_up.value if gave_up is not None else ""

    def see(self, observation: Observation, _: Command, __: Action) -> bool:
        if self.prediction is None:
            self.prediction = prediction_of(self._navigator, observation)
        return self._navigator.gave_up is None


def _keep(output: Path, results: list[EpisodeResult], prediction: Prediction | None) -> None:
    last = results[-1]
    if prediction is not None:
        row = arrival_row(
            prediction,
            episode=last.episode,
            seed=last.seed,
            outcome=last.outcome,
            reason=last.reason,
            time_of_arrival_s=last.time_of_arrival_s,
        )
        append_arrival(output / "arrivals.csv", row)
    save_episodes(output / "episodes.csv", results)


def _result(record: EpisodeRecord, reason: str, wall_s: float) -> EpisodeResult:
    arrived = record.outcome == "arrived"
    return EpisodeResult(
        episode=record.episode,
        seed=record.seed,
        driver=record.driver,
        start_area=record.start_area,
        outcome=record.outcome,
        time_of_arrival_s=record.time_of_arrival_s if arrived else math.nan,
        duration_s=record.duration_s,
        distance_m=record.distance_m,
        robot_on_person=record.contacts.robot_on_person,
        person_on_robot=record.contacts.person_on_robot,
        robot_on_wall=record.contacts.robot_on_wall,
        minimum_person_distance_m=record.minimum_person_distance_m,
        wall_s=wall_s,
        reason="" if arrived else reason,
    )
