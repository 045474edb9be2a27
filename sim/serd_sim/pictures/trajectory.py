"""Who was where during an episode, tick by tick."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.grid.grid import Action
from serd_sim.errors import SimError
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation


@dataclass(frozen=True, eq=False)
class Trajectory:
    """time_s: (T,); robot_pose: (T, 3) x, y, yaw; people_position_m: (T, N, 2)."""

    time_s: FloatArray
    robot_pose: FloatArray
    people_position_m: FloatArray


class TrajectoryRecorder:
    """Pass `see` to run_episode as its observer, then read `trajectory`."""

    def __init__(self) -> None:
        self._seen: list[Observation] = []

    def see(self, observation: Observation, _command: Command, _action: Action) -> None:
        """Take one control tick."""
        self._seen.append(observation)

    @property
    def trajectory(self) -> Trajectory:
        """Everything seen so far; SimError when that is nothing."""
        if not self._seen:
            raise SimError("nothing was recorded; pass `see` as the observer of run_episode")
        return Trajectory(
            time_s=np.array([seen.time_s for seen in self._seen]),
            robot_pose=np.array([seen.pose for seen in self._seen]),
            people_position_m=np.stack([seen.people_position_m for seen in self._seen]),
        )
