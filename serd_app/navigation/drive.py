"""A series of episodes of the strategy in process: world, planner and navigator of the nodes."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from serd_app.demonstrations.crossing_table import (
    CrossedPlace,
    Crossing,
    crossings_of_track,
    load_crossings,
    people_per_m2,
    save_crossings,
)
from serd_app.navigation.arrival_records import ArrivalRecords
from serd_app.navigation.navigator import Navigator
from serd_app.navigation.settings import NavigationSettings
from serd_app.navigation.strategy import Strategy
from serd_core.grid.grid import Action
from sim.episodes.episode import EpisodeRecord, run_episode
from sim.episodes.result import result_of_record
from sim.episodes.settings import WorldSettings
from sim.planning.catalogue import make_planner
from sim.scenario.scenario import Scenario, load_scenario
from sim.world.command import Command
from sim.world.observation import Observation
from sim.world.world import HallwayWorld
from storage.episode_table import EpisodeResult, load_episodes, save_episodes

#: File of the crossings of a drive, in its folder.
CROSSINGS = "crossings.csv"


class DriveSettings(NavigationSettings, WorldSettings):
    """Settings of a series of episodes in the simulated world."""

    def place(self) -> Scenario:
        """The scenario with its people, and its own goal."""
        own = load_scenario(self.scenario)
        return own if self.people is None else own.with_pedestrian_count(self.people)


def finished_episodes(settings: DriveSettings, output: Path | None) -> list[EpisodeResult]:
    """The episodes of an interrupted drive; none without its table."""
    table = None if output is None else output / "episodes.csv"
    if table is None or not table.is_file():
        return []
    return list(load_episodes(table)[: settings.episodes])


def drive(
    settings: DriveSettings,
    output: Path | None,
    on_episode: Callable[[EpisodeResult], None],
) -> list[EpisodeResult]:
    """Drive the episodes that are not finished yet; the rows of all of them.

    output: folder that gets each row as it comes, none when None.
    """
    navigator = Navigator(settings.place(), settings)
    records, results = ArrivalRecords(output), finished_episodes(settings, output)
    crossings, poses = _earlier_crossings(output, len(results)), list[tuple[float, ...]]()
    place = _crossed_place(navigator.strategy, settings.lookahead_cells)

    def observe(observation: Observation, _: Command, __: Action) -> bool:
        records.note_decision(navigator, observation)
        poses.append((observation.time_s, observation.x_m, observation.y_m))
        return not navigator.reason

    with HallwayWorld(navigator.strategy.scenario, seed=settings.seed) as world:
        planner = make_planner(settings.planner, navigator.strategy.scenario)
        for episode in range(len(results), settings.episodes):
            began_s = time.monotonic()
            poses.clear()
            record = run_episode(
                world,
                planner,
                navigator,
                episode=episode,
                start_area=settings.start_area,
                timeout_s=settings.timeout_s,
                observer=observe,
                waypoint_of=navigator.waypoint_of,
            )
            wall_s = time.monotonic() - began_s
            results.append(result_of_record(record, reason=navigator.reason, wall_s=wall_s))
            records.note_result(results[-1])
            if output is not None:
                last = world.observation
                poses.append((last.time_s, last.x_m, last.y_m))
                crossings += _crossings_of(place, record, poses)
                save_crossings(output / CROSSINGS, crossings)
                save_episodes(output / "episodes.csv", results)
            on_episode(results[-1])
    return results


def _crossed_place(strategy: Strategy, lookahead_cells: int) -> CrossedPlace:
    grid, n_people = strategy.problem.grid, strategy.scenario.pedestrians.count
    return CrossedPlace(grid, strategy.problem.flow, lookahead_cells, people_per_m2(grid, n_people))


def _crossings_of(
    place: CrossedPlace, record: EpisodeRecord, poses: list[tuple[float, ...]]
) -> list[Crossing]:
    track, made = np.array(poses), record.decisions
    track = track[np.unique(track[:, 0], return_index=True)[1]]
    decided = np.stack([made.time_s, made.action], axis=1)
    return crossings_of_track(
        place, record.episode, track, decided, arrived=record.outcome == "arrived"
    )


def _earlier_crossings(output: Path | None, n_finished: int) -> list[Crossing]:
    """Those of the finished episodes of an interrupted drive."""
    table = None if output is None else output / CROSSINGS
    if table is None or not table.is_file():
        return []
    return [row for row in load_crossings(table) if row.episode < n_finished]
