"""The hallway world: people, robot, lidar and clock, advanced one control period at a time.

What happens in an episode depends on the scenario, the seed, the episode number and the start area
only. Time runs on from episode to episode; an episode starts after a gap by which observations of
it are distinguished from those of the last.
"""

import math

import numpy as np
from numpy.typing import NDArray

from serd_core.grid.grid import Grid
from serd_sim.crowd.crowd import Crowd, start_crowd
from serd_sim.crowd.social_force import model_named
from serd_sim.errors import SimError
from serd_sim.robot.physical_robot import PhysicalRobot
from serd_sim.robot.robot import ContactCounter, ContactCounts, KinematicRobot
from serd_sim.robot.sensors import Lidar, Odometry
from serd_sim.scenario.grid import Area, grid_of, is_at_goal, start_states_of
from serd_sim.scenario.polygon import distance_to_segments_m
from serd_sim.scenario.rules import START_SPREAD
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.observation import (
    CROWD,
    EPISODE_GAP_S,
    LIDAR,
    ODOMETRY,
    START,
    Observation,
    episode_rng,
)


class HallwayWorld:
    """One world; call `reset`, then `step` with a command every control period.

    goal_area_m: may be set to another area at any time.
    """

    def __init__(self, scenario: Scenario, *, seed: int) -> None:
        person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self.scenario = scenario
        self.seed = seed
        self.grid: Grid = grid_of(scenario)
        self.goal_area_m: Area = scenario.goal_area_m
        self.tick = 0
        self.n_rejected_commands = 0
        self._lidar = Lidar(scenario.lidar, scenario.wall_segments_m, person_radius_m)
        self._robot = (
            PhysicalRobot(scenario, person_radius_m)
            if scenario.robot.drive == "physical"
            else KinematicRobot(scenario)
        )
        self._episode = self._first_tick = 0
        self._contacts = ContactCounter(0)
        self._odometry = Odometry(scenario.odometry, self._robot.state.pose, self._rng(ODOMETRY))
        self._crowd: Crowd | None = None
        self._observation: Observation | None = None
        self._scanned: tuple[Observation, NDArray[np.float32]] | None = None

    def reset(self, episode: int, start_area: str = "train") -> Observation:
        """Begin an episode after a gap in time: new people, warmed up, and the robot standing at a
        random start."""
        if self._crowd is not None:
            # A multiple of the period of scans: they come at the same times of every episode,
            # however long the world went on after the last one.
            per_scan = self.scenario.ticks_per_scan
            earliest = self.tick + round(EPISODE_GAP_S / self.scenario.control_period_s)
            self.tick = math.ceil(earliest / per_scan) * per_scan
        self._episode, self._first_tick = episode, self.tick
        start = self._draw_start(self._rng(START), start_area)
        self._robot.place(start)
        self._odometry = Odometry(self.scenario.odometry, start, self._rng(ODOMETRY))
        loops, walls_m = self.scenario.pedestrians.loops, self.scenario.wall_segments_m
        self._crowd = start_crowd(self.scenario.pedestrians, loops, walls_m, self._rng(CROWD))
        self._contacts = ContactCounter(len(self._crowd))
        for _ in range(round(self.scenario.pedestrians.warm_up_s / self.scenario.control_period_s)):
            self._move_people(self._crowd)
            self._crowd.push_out_of(self._robot.body)
        return self._observed_now()

    def step(self, command: Command) -> Observation:
        """Advance by one control period; a command that is not finite stops the robot."""
        crowd = self._running()
        self._move_people(crowd)
        if not command.is_finite:
            self.n_rejected_commands += 1
            command = STOP
        touches = self._robot.drive(command, crowd)
        body = self._robot.body
        if self._robot.wheel_motion is None:
            self._odometry.follow(self._robot.state.pose)
        else:
            self._odometry.add(*self._robot.wheel_motion)
        self._contacts.update(crowd, body, self._robot.wall_distance_m, touches)
        if touches is None:  # the physical drive pushes people itself
            crowd.push_out_of(body)
        self.tick += 1
        return self._observed_now()

    def _move_people(self, crowd: Crowd) -> None:
        """One control period of the people."""
        seen = self._robot.body if self.scenario.pedestrians.robot_visible else None
        crowd.step(self.scenario.control_period_s, seen)

    def _observed_now(self) -> Observation:
        """Make the observation of the present tick."""
        crowd, robot = self._running(), self._robot.state
        self._observation = Observation(
            time_s=self.time_s,
            tick=self.tick,
            pose=robot.pose,
            speed_mps=robot.speed_mps,
            yaw_rate_radps=robot.yaw_rate_radps,
            people_position_m=crowd.position_m,
            people_velocity_mps=crowd.velocity_mps,
            people_id=np.arange(len(crowd)),
        )
        return self._observation

    @property
    def observation(self) -> Observation:
        """The last observation."""
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
        """Whether the robot's centre, or that of its cell, is in the goal area."""
        return is_at_goal(self.scenario, self.goal_area_m, *self._robot.state.pose[:2])

    @property
    def odometry_pose(self) -> tuple[float, float, float]:
        """(x_m, y_m, yaw_rad) by the wheels alone, from the true pose at the episode's start."""
        self._running()
        return self._odometry.pose

    @property
    def is_scan_tick(self) -> bool:
        """Whether the lidar has a new scan at this tick."""
        return self.tick % self.scenario.ticks_per_scan == 0

    def scan(self, observation: Observation | None = None) -> NDArray[np.float32]:
        """(n_rays,) lidar ranges from the observed pose among the people as they are now.

        Asked again at the same tick, the noise is the same. The scan of the present observation is
        made once; do not write to it.
        """
        crowd = self._running()
        seen = observation if observation is not None else self.observation
        if self._scanned is not None and self._scanned[0] is seen is self._observation:
            return self._scanned[1]
        rng = None
        if self.scenario.lidar.noise_deviation_m > 0:
            rng = self._rng(LIDAR, self.tick - self._first_tick)
        people = crowd.x_m, crowd.y_m
        ranges_m = self._lidar.scan(seen.pose, *people, rng)
        self._scanned = seen, ranges_m
        return ranges_m

    def close(self) -> None:
        """Give PyBullet's world back; a second call does nothing."""
        self._robot.close()

    def __enter__(self) -> "HallwayWorld":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _running(self) -> Crowd:
        if self._crowd is None:
            raise SimError("the world must be reset before use; call reset(episode) first")
        return self._crowd

    def _rng(self, purpose: int, *more: int) -> np.random.Generator:
        """Random numbers of this episode."""
        return episode_rng(self.seed, self._episode, purpose, *more)

    def _draw_start(self, rng: np.random.Generator, area: str) -> tuple[float, float, float]:
        state = rng.choice(start_states_of(self.scenario, self.grid, area))
        middle_m, walls_m = self.scenario.cells.middles_m[state], self.scenario.wall_segments_m
        nearest_m = float(distance_to_segments_m(middle_m, walls_m).min())
        room_m = nearest_m - self.scenario.robot.radius_m
        spread_m = START_SPREAD * self.grid.cell_size_m
        if room_m < spread_m:
            spread_m = min(spread_m, max(room_m, 0.0) / math.sqrt(2.0))
        x_m, y_m = middle_m + rng.uniform(-spread_m, spread_m, 2)
        return float(x_m), float(y_m), float(rng.uniform(-math.pi, math.pi))
