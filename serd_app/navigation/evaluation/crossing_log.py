"""The crossings of cells of drives, written beside their episodes: in process and by nodes."""

from pathlib import Path

import numpy as np

from serd_app.demonstrations.crossing_table import (
    CrossedPlace,
    Crossing,
    crossings_of_track,
    load_crossings,
    people_per_m2,
)
from serd_app.navigation.strategy import Strategy
from serd_core.grid.grid import Action
from serd_files.episode_table import EpisodeResult
from serd_files.table import write_rows
from serd_sim.world.observation import Observation

#: Its file, in the folder of a drive.
CROSSINGS = "crossings.csv"


class CrossingLog:
    """Writes `crossings.csv` into the folder `output`; nothing when it is None.

    n_finished: episodes of an interrupted drive, whose rows are kept; None to keep all rows that
    are there, and number further episodes on.
    """

    def __init__(self, output: Path | None, n_finished: int | None = None) -> None:
        self._path = None if output is None else output / CROSSINGS
        kept = load_crossings(self._path) if self._path and self._path.is_file() else ()
        self._rows = [row for row in kept if n_finished is None or row.episode < n_finished]
        earlier = -1 if n_finished is not None else max((row.episode for row in kept), default=-1)
        self._first_episode = earlier + 1
        self._poses = list[tuple[float, float, float]]()
        self._decided = list[tuple[float, int]]()

    def begin(self) -> None:
        """Discard what was noted of an episode that has no result."""
        self._poses.clear()
        self._decided.clear()

    def note_pose(self, observation: Observation) -> None:
        """Where the robot was, the end of the episode included."""
        self._poses.append((observation.time_s, observation.x_m, observation.y_m))

    def note_decision(self, observation: Observation, action: Action) -> None:
        """What was decided there."""
        self._decided.append((observation.time_s, int(action)))

    def note_result(self, strategy: Strategy, lookahead_cells: int, result: EpisodeResult) -> None:
        """Append the crossings of the episode that has ended."""
        if self._path is not None and self._poses:
            grid, n_people = strategy.problem.grid, strategy.scenario.pedestrians.count
            density = people_per_m2(grid, n_people)
            place = CrossedPlace(grid, strategy.problem.flow, lookahead_cells, density)
            track = np.array(self._poses)
            self._rows += crossings_of_track(
                place,
                self._first_episode + result.episode,
                track[np.unique(track[:, 0], return_index=True)[1]],
                np.array(self._decided).reshape(-1, 2),
                arrived=result.arrived,
            )
            write_rows(self._path, Crossing, self._rows)
        self.begin()
