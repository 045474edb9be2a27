"""The hallway world: people, robot, lidar and clock, advanced one control period at a time.

What happens in an episode depends on the scenario, the seed, the episode number and the start area
only. Time runs on from episode to episode; an episode starts at a whole decision period after a gap
by which observations of it are distinguished from those of the last.
"""

import math
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from serd_core.grid.grid import Grid
from sim.crowd.crowd import Crowd, start_crowd
from sim.crowd.social_force import model_named
from sim.errors import SimError
from sim.pictures.camera import Camera, overview_camera
from sim.pictures.scene import Scene
from sim.robot.contacts import ContactCounter, ContactCounts, ContactEvent, Touch
from sim.robot.imu import Imu, ImuReading
from sim.robot.lidar import Lidar
from sim.robot.odometry import Odometry
from sim.robot.physical_robot import PhysicalRobot
from sim.robot.robot import KinematicRobot, RobotState, standing_at
from sim.scenario.goal import Area
from sim.scenario.grid import grid_of, start_states_of
from sim.scenario.obstacle import Pose
from sim.scenario.occupancy import OccupancyRaster, occupancy_raster
from sim.scenario.polygon import contains_point, edges_of
from sim.scenario.rules import START_SPREAD
from sim.scenario.scenario import Scenario, scenario_digest
from sim.world.command import STOP, Command
from sim.world.observation import Observation, make_observation
from sim.world.seeds import CROWD, IMU, LIDAR, ODOMETRY, START, episode_rng


@dataclass(frozen=True, eq=False)
class WorldState:
    """A snapshot of a world of one scenario and seed; after a restore, steps repeat exactly."""

    scenario_digest: str
    seed: int
    episode: int
    tick: int
    first_tick: int
    n_rejected_commands: int
    goal_area_m: Area
    robot: RobotState
    crowd: Crowd
    contacts: ContactCounter
    odometry: Odometry
    imu: Imu


class HallwayWorld:
    """One world; call `reset`, then `step` with a command every control period."""

    def __init__(self, scenario: Scenario, *, seed: int, gui: bool = False) -> None:
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
        try:
            self._window = Scene(scenario, gui=True) if gui else None
        except BaseException:
            self._robot.close()
            raise
        self._pictures: Scene | None = None
        self._episode = self._first_tick = 0
        self._contacts = ContactCounter(0)
        self._odometry = Odometry(
            scenario.odometry, self._robot.state.pose, episode_rng(seed, 0, ODOMETRY)
        )
        self._imu = self._new_imu(0)
        self._crowd: Crowd | None = None
        self._observation: Observation | None = None
        self._scanned: tuple[Observation, NDArray[np.float32]] | None = None

    def reset(self, episode: int, start_area: str = "train") -> Observation:
        """Begin an episode: new people, warmed up, and the robot standing at a random start."""
        if self._crowd is not None:
            per_decision = self.scenario.ticks_per_decision
            self.tick = (self.tick // per_decision + 2) * per_decision
        pose = self._draw_start(episode_rng(self.seed, episode, START), start_area)
        self._begin(episode, standing_at(pose))
        self._warm_up()
        self._observation = self._observe()
        return self._observation

    def step(self, command: Command) -> Observation:
        """Advance by one control period; a command that is not finite stops the robot."""
        crowd = self._running()
        if not command.is_finite:
            self.n_rejected_commands += 1
            command = STOP
        seen = self._robot.body if self.scenario.pedestrians.robot_visible else None
        crowd.step(self.scenario.control_period_s, seen)
        touches = self._robot.drive(command, crowd)
        if self._robot.wheel_motion is None:
            self._odometry.follow(self._robot.state.pose)
        else:
            self._odometry.add(*self._robot.wheel_motion)
        self._imu.follow(self._robot.inertial)
        self._contacts.update(crowd, self._robot.body, self._robot.wall_distance_m, touches)
        if touches is None:
            crowd.push_out_of(self._robot.body)
        if self._robot.obstacle_poses:
            crowd.set_walls(self._walls_of_people_m())
        self.tick += 1
        if self._window is not None:
            self._show_in(self._window)
        self._observation = self._observe()
        return self._observation

    def set_goal(self, goal_area_m: Area) -> None:
        """Set another area as the goal from now on."""
        self.goal_area_m = goal_area_m

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
    def contact_events(self) -> tuple[ContactEvent, ...]:
        """Contacts in this episode, in their order; the physical drive alone has them."""
        return self._contacts.events

    @property
    def minimum_person_distance_m(self) -> float:
        """Smallest gap between the robot and a person in this episode, inf when alone."""
        return float(self._contacts.minimum_distance_m)

    @property
    def in_goal(self) -> bool:
        """Whether the robot's centre is in the goal area."""
        return contains_point(self.goal_area_m, *self._robot.state.pose[:2])

    @property
    def odometry_pose(self) -> tuple[float, float, float]:
        """(x_m, y_m, yaw_rad) by the wheels alone, from the true pose at the episode's start."""
        self._running()
        return self._odometry.pose

    @property
    def imu(self) -> ImuReading:
        """Angular velocity and acceleration of the last control period."""
        self._running()
        return self._imu.reading

    @property
    def bumper(self) -> tuple[Touch, ...]:
        """What touched the hull in the last control period; the physical drive alone has it."""
        touches = self._contacts.touches
        return touches.all if touches else ()

    @property
    def obstacle_poses(self) -> tuple[Pose, ...]:
        """(x_m, y_m, yaw_rad) of the scenario's movable obstacles."""
        return self._robot.obstacle_poses

    @property
    def obstacle_outlines_m(self) -> list[FloatArray]:
        """(n, 2) corners of each movable obstacle as it is."""
        pairs = zip(self.scenario.movable_obstacles, self.obstacle_poses, strict=True)
        return [obstacle.outline_at(pose) for obstacle, pose in pairs]

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
            rng = episode_rng(self.seed, self._episode, LIDAR, self.tick - self._first_tick)
        ranges_m = self._lidar.scan(
            seen.pose, crowd.x_m, crowd.y_m, rng, self._robot.obstacle_segments_m
        )
        self._scanned = seen, ranges_m
        return ranges_m

    def map_raster(self, resolution_m: float = 0.05) -> OccupancyRaster:
        """The map for people and planners."""
        return occupancy_raster(self.scenario, resolution_m)

    def picture(self, camera: Camera | None = None) -> NDArray[np.uint8]:
        """(height, width, 3) picture of the world now, the whole of it when no camera is given."""
        scene = self._window or self._pictures
        if scene is None:
            scene = self._pictures = Scene(self.scenario)
        self._show_in(scene)
        return scene.render(camera if camera else overview_camera(self.scenario))

    def snapshot(self) -> WorldState:
        """Copy of all that changes; it can be pickled."""
        return WorldState(
            scenario_digest=scenario_digest(self.scenario),
            seed=self.seed,
            episode=self._episode,
            tick=self.tick,
            first_tick=self._first_tick,
            n_rejected_commands=self.n_rejected_commands,
            goal_area_m=self.goal_area_m,
            robot=self._robot.snapshot(),
            crowd=deepcopy(self._running()),
            contacts=deepcopy(self._contacts),
            odometry=deepcopy(self._odometry),
            imu=deepcopy(self._imu),
        )

    def restore(self, state: WorldState) -> Observation:
        """Return to a snapshot of a world of this scenario and seed, also of another process."""
        if state.scenario_digest != scenario_digest(self.scenario):
            raise SimError(
                f"state must be of this world's scenario {self.scenario.name!r} as it is, got "
                "one of another scenario or version of it; make the world with that one"
            )
        if state.seed != self.seed:
            raise SimError(
                f"state must be of this world's seed {self.seed}, got seed {state.seed}"
                f"; make the world with seed={state.seed}"
            )
        self._robot.place(state.robot)
        self._crowd, self._contacts = deepcopy(state.crowd), deepcopy(state.contacts)
        self._odometry, self._imu = deepcopy(state.odometry), deepcopy(state.imu)
        self._episode, self.tick, self._first_tick = state.episode, state.tick, state.first_tick
        self.n_rejected_commands, self.goal_area_m = state.n_rejected_commands, state.goal_area_m
        self._observation = self._observe()
        return self._observation

    def close(self) -> None:
        """Give PyBullet's world back; a second call does nothing."""
        self._robot.close()
        for scene in (self._window, self._pictures):
            if scene is not None:
                scene.close()

    def __enter__(self) -> "HallwayWorld":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _running(self) -> Crowd:
        if self._crowd is None:
            raise SimError("the world must be reset before use; call reset(episode) first")
        return self._crowd

    def _show_in(self, scene: Scene) -> None:
        """Put robot and people of a scene where they are."""
        crowd = self._running()
        scene.place_robot(self._robot.state.pose)
        scene.place_obstacles(self._robot.obstacle_poses)
        scene.place_people(
            np.stack([crowd.x_m, crowd.y_m], axis=1),
            np.stack([crowd.velocity_x_mps, crowd.velocity_y_mps], axis=1),
        )

    def _walls_of_people_m(self) -> FloatArray:
        """(W, 2, 2) what people keep clear of: walls and movable obstacles but doors."""
        pairs = zip(self.scenario.movable_obstacles, self.obstacle_outlines_m, strict=True)
        free = [edges_of(outline_m) for each, outline_m in pairs if each.hinge_m is None]
        return np.concatenate([self.scenario.wall_segments_m, *free])

    def _begin(self, episode: int, robot: RobotState) -> None:
        """New people on their loops, not yet warmed up, and the robot in the given state."""
        self._episode = episode
        self._first_tick = self.tick
        self._robot.place(robot)
        self._odometry = Odometry(
            self.scenario.odometry, robot.pose, episode_rng(self.seed, episode, ODOMETRY)
        )
        self._imu = self._new_imu(episode)
        self._crowd = start_crowd(
            self.scenario.pedestrians,
            self.scenario.directed_loops,
            self._walls_of_people_m(),
            episode_rng(self.seed, episode, CROWD),
        )
        self._contacts = ContactCounter(len(self._crowd))

    def _new_imu(self, episode: int) -> Imu:
        rng = episode_rng(self.seed, episode, IMU)
        return Imu(self.scenario.imu, self.scenario.control_period_s, self._robot.inertial, rng)

    def _draw_start(self, rng: np.random.Generator, area: str) -> tuple[float, float, float]:
        state = rng.choice(start_states_of(self.scenario, self.grid, area))
        spread = START_SPREAD * self.grid.cell_size_m
        x_m, y_m = self.grid.centers_m[state] + rng.uniform(-spread, spread, 2)
        return float(x_m), float(y_m), float(rng.uniform(-math.pi, math.pi))

    def _warm_up(self) -> None:
        crowd, step_s = self._running(), self.scenario.control_period_s
        seen = self._robot.body if self.scenario.pedestrians.robot_visible else None
        for _ in range(round(self.scenario.pedestrians.warm_up_s / step_s)):
            crowd.step(step_s, seen)
            crowd.push_out_of(self._robot.body)

    def _observe(self) -> Observation:
        crowd, robot = self._running(), self._robot.state
        return make_observation(
            time_s=self.time_s,
            tick=self.tick,
            pose=robot.pose,
            speed_mps=robot.speed_mps,
            yaw_rate_radps=robot.yaw_rate_radps,
            people_position_m=np.stack([crowd.x_m, crowd.y_m], axis=1),
            people_velocity_mps=np.stack([crowd.velocity_x_mps, crowd.velocity_y_mps], axis=1),
            people_id=np.arange(len(crowd)),
        )
