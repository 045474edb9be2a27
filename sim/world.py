"""The hallway world: people, robot, lidar and clock, advanced one control period at a time.

What happens in an episode depends on the scenario, the seed, the episode number and the start area
only. Time runs on from episode to episode; an episode starts at a whole decision period after a gap
by which anyone who sees the observations can tell it from the last.
"""

import math
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from serd_core.grid import Grid
from sim.command import STOP, Command
from sim.contacts import ContactCounter, ContactCounts
from sim.crowd import Crowd, RobotBody, start_crowd
from sim.errors import SimError
from sim.lidar import Lidar
from sim.observation import Observation, make_observation
from sim.occupancy import OccupancyRaster, occupancy_raster
from sim.physics import Physics
from sim.polygon import contains
from sim.scenario import Scenario
from sim.scenario_grid import grid_of, start_states_of
from sim.seeds import CROWD, START, episode_rng
from sim.social_force import model_named
from sim.unicycle import chord_velocity, limited_velocity
from sim.wall_geometry import WallGeometry

_START_SPREAD = 0.2
_LIDAR_HEIGHT_M = 0.3


class HallwayWorld:
    """One world; call `reset`, then `step` with a command every control period."""

    def __init__(self, scenario: Scenario, *, seed: int, gui: bool = False) -> None:
        self.scenario = scenario
        self.seed = seed
        self.grid: Grid = grid_of(scenario)
        self.tick = 0
        self.n_rejected_commands = 0
        self._gui = gui
        self._lidar = Lidar(scenario.lidar, _LIDAR_HEIGHT_M)
        self._physics = Physics(
            scenario, model_named(scenario.pedestrians.model).body_radius_m, gui=gui
        )
        self._walls = WallGeometry(1, scenario.wall_segments_m)
        self._goal_area = np.array(scenario.goal_area_m)
        self._crowd: Crowd | None = None
        self._observation: Observation | None = None

    def reset(self, episode: int, start_area: str = "train") -> Observation:
        """Begin an episode: new people, warmed up, and the robot standing at a random start."""
        if self._crowd is not None:
            per_decision = self.scenario.ticks_per_decision
            self.tick = (self.tick // per_decision + 2) * per_decision
        pose = self._draw_start(episode_rng(self.seed, episode, START), start_area)
        self._physics.place_robot(*pose)
        self._pose = pose
        self._speed_mps = self._yaw_rate_radps = 0.0
        self._crowd = start_crowd(
            self.scenario.pedestrians,
            self.scenario.directed_loops,
            self.scenario.wall_segments_m,
            episode_rng(self.seed, episode, CROWD),
        )
        self._warm_up()
        self._contacts = ContactCounter(len(self._crowd))
        self._observation = self._observe()
        return self._observation

    def step(self, command: Command) -> Observation:
        """Advance by one control period; a command that is not finite stops the robot."""
        crowd = self._running()
        if not command.is_finite:
            self.n_rejected_commands += 1
            command = STOP
        step_s = self.scenario.control_period_s
        crowd.step(step_s, self._robot_body() if self._sees_robot else None)
        self._drive(command, step_s)
        robot = self._robot_body()
        self._contacts.update(crowd, robot, self._wall_distance_m)
        crowd.push_out_of(robot)
        self.tick += 1
        if self._gui:
            self._physics.place_people(crowd.x_m, crowd.y_m)
        self._observation = self._observe()
        return self._observation

    @property
    def observation(self) -> Observation:
        """What the sensors told last."""
        self._running()
        assert self._observation is not None
        return self._observation

    @property
    def time_s(self) -> float:
        """Simulated time since the world was made."""
        return self.tick * self.scenario.control_period_s

    @property
    def contacts(self) -> ContactCounts:
        """Contacts in this episode."""
        return self._contacts.counts

    @property
    def minimum_person_distance_m(self) -> float:
        """Smallest gap between the robot and a person in this episode, inf when alone."""
        return float(self._contacts.minimum_distance_m)

    @property
    def in_goal(self) -> bool:
        """Whether the robot's centre is in the goal area."""
        return bool(contains(self._goal_area, self._pose[:2])[0])

    def scan(self, observation: Observation | None = None) -> NDArray[np.float32]:
        """(n_rays,) lidar ranges from the observed pose among the people as they are now."""
        crowd = self._running()
        self._physics.place_people(crowd.x_m, crowd.y_m)
        seen = observation if observation is not None else self.observation
        return self._lidar.scan(self._physics, seen.pose)

    def map_raster(self, resolution_m: float = 0.05) -> OccupancyRaster:
        """The map for people and planners."""
        return occupancy_raster(self.scenario, resolution_m)

    def close(self) -> None:
        """Give PyBullet's world back; a second call does nothing."""
        self._physics.close()

    def __enter__(self) -> "HallwayWorld":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def _sees_robot(self) -> bool:
        return self.scenario.pedestrians.robot_visible

    def _running(self) -> Crowd:
        if self._crowd is None:
            raise SimError("the world must be reset before use; call reset(episode) first")
        return self._crowd

    def _draw_start(self, rng: np.random.Generator, area: str) -> tuple[float, float, float]:
        state = rng.choice(start_states_of(self.scenario, self.grid, area))
        spread = _START_SPREAD * self.grid.cell_size_m
        x_m, y_m = self.grid.centers_m[state] + rng.uniform(-spread, spread, 2)
        return float(x_m), float(y_m), float(rng.uniform(-math.pi, math.pi))

    def _warm_up(self) -> None:
        crowd, step_s = self._running(), self.scenario.control_period_s
        robot = self._robot_body() if self._sees_robot else None
        for _ in range(round(self.scenario.pedestrians.warm_up_s / step_s)):
            crowd.step(step_s, robot)
            crowd.push_out_of(self._robot_body())

    def _drive(self, command: Command, step_s: float) -> None:
        """One control period of the unicycle; what a wall takes of the speed is lost."""
        speed, yaw_rate = limited_velocity(
            command, self._speed_mps, self._yaw_rate_radps, self.scenario.robot, step_s
        )
        before = self._pose
        self._physics.move_robot(chord_velocity(before[2], speed, yaw_rate, step_s), yaw_rate)
        self._pose = self._physics.robot_pose()
        self._wall_distance_m = self._distance_to_walls_m()
        if self._wall_distance_m < self.scenario.robot.radius_m + 0.02:
            moved_x, moved_y = self._pose[0] - before[0], self._pose[1] - before[1]
            yaw = self._pose[2]
            speed = (moved_x * math.cos(yaw) + moved_y * math.sin(yaw)) / step_s
        self._speed_mps, self._yaw_rate_radps = speed, yaw_rate

    def _distance_to_walls_m(self) -> float:
        here: FloatArray = np.array(self._pose[:2])
        self._walls.update(here[:1], here[1:])
        return float(self._walls.distance_m.min())

    def _robot_body(self) -> RobotBody:
        x_m, y_m, yaw = self._pose
        return RobotBody(
            x_m=x_m,
            y_m=y_m,
            velocity_x_mps=self._speed_mps * math.cos(yaw),
            velocity_y_mps=self._speed_mps * math.sin(yaw),
            radius_m=self.scenario.robot.radius_m,
        )

    def _observe(self) -> Observation:
        crowd = self._running()
        return make_observation(
            time_s=self.time_s,
            tick=self.tick,
            pose=self._pose,
            speed_mps=self._speed_mps,
            yaw_rate_radps=self._yaw_rate_radps,
            people_position_m=np.stack([crowd.x_m, crowd.y_m], axis=1),
            people_velocity_mps=np.stack([crowd.velocity_x_mps, crowd.velocity_y_mps], axis=1),
            people_id=np.arange(len(crowd)),
        )
