"""Baselines for comparisons: behaviours of the library navground as local planners.

orca: Optimal Reciprocal Collision Avoidance (van den Berg et al., 2011); human_like: Guzzi et al.
(ICRA 2013); social_force: Helbing & Molnár (1995); straight: drives to the waypoint and ignores
people and walls. Parameters are those of the library, but for the limits of the robot and the time
horizons of ORCA, with which it does not stand still in corridors.
"""

import math
from dataclasses import dataclass
from typing import Any

from serd_files.table import Column, Row
from serd_sim.crowd.social_force import model_named
from serd_sim.episodes.batch import COLUMNS, TASK_COLUMNS, EpisodeTask, run_task
from serd_sim.errors import SimError
from serd_sim.planning.recovery import RecoveringPlanner
from serd_sim.planning.rollouts import speed_to_stop_within
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld

#: Name -> behaviour of navground.
BASELINES = {
    "orca": "ORCA",
    "human_like": "HL",
    "social_force": "SocialForce",
    "straight": "Dummy",
}
#: How far ahead (s) ORCA avoids people and walls.
_TIME_HORIZON_S = 2.0
_WALL_TIME_HORIZON_S = 0.5
#: People and walls farther than this (m) are ignored.
_HORIZON_M = 5.0


@dataclass(frozen=True)
class BaselineTask(EpisodeTask):
    """An episode that a baseline drives in place of the planner."""

    baseline: str = "orca"


#: Columns of the table, and the fields of a task.
BASELINE_COLUMNS = (*COLUMNS, Column("baseline", str))
BASELINE_KEY = (*TASK_COLUMNS, "baseline")


def run_baseline(task: BaselineTask) -> Row:
    """Run one episode; its row."""

    def planner_of(_: str, world: HallwayWorld, __: str) -> RecoveringPlanner:
        return RecoveringPlanner(BaselinePlanner(task.baseline, world.scenario), world.scenario)

    return {**run_task(task, planner_of), "baseline": task.baseline}


class BaselinePlanner:
    """A behaviour of navground that drives a robot with two wheels. `is_blocked` is never true."""

    is_blocked = False

    def __init__(self, name: str, scenario: Scenario) -> None:
        self._core = core = _navground()
        self._robot = robot = scenario.local_planner.limited(scenario.robot)
        self._period_s = scenario.control_period_s
        self._tolerance_m = scenario.local_planner.xy_goal_tolerance
        self._person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        behaviour = core.Behavior.make_type(BASELINES[name])
        wheels = core.Kinematics.make_type("2WDiff")
        wheels.max_speed = robot.max_vel_x_mps
        wheels.wheel_axis = 2.0 * robot.max_vel_x_mps / robot.max_vel_theta_radps
        behaviour.kinematics = wheels
        behaviour.radius = robot.radius_m
        behaviour.horizon = _HORIZON_M
        behaviour.optimal_angular_speed = robot.max_vel_theta_radps
        if name == "orca":
            behaviour.time_horizon = _TIME_HORIZON_S
            behaviour.static_time_horizon = _WALL_TIME_HORIZON_S
        self._behaviour = behaviour
        self._sees = isinstance(behaviour.environment_state, core.GeometricState)
        if self._sees:
            behaviour.environment_state.line_obstacles = [
                core.LineSegment(tuple(start), tuple(end))
                for start, end in scenario.wall_segments_m
            ]

    def reset(self) -> None:
        """Discard the last command, the one state of a behaviour."""
        core = self._core
        self._behaviour.actuated_twist = core.Twist2((0.0, 0.0), 0.0, frame=core.Frame.relative)

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
        if waypoint is None:
            return STOP
        x_m, y_m, yaw_rad = observation.pose
        distance_m = math.hypot(waypoint.x_m - x_m, waypoint.y_m - y_m)
        if distance_m < self._tolerance_m:
            return STOP
        core, behaviour = self._core, self._behaviour
        behaviour.pose = core.Pose2((x_m, y_m), yaw_rad)
        behaviour.twist = core.Twist2(
            (observation.speed_mps, 0.0), observation.yaw_rate_radps, frame=core.Frame.relative
        )
        behaviour.optimal_speed = max(
            0.0, min(self._robot.max_vel_x_mps, speed_to_stop_within(distance_m, self._robot))
        )
        behaviour.target = core.Target.Point((waypoint.x_m, waypoint.y_m), 0.0)
        if self._sees:
            self._behaviour.environment_state.neighbors = self._neighbours(observation)
        command = behaviour.compute_cmd(self._period_s, core.Frame.relative, True)
        return Command(float(command.velocity[0]), float(command.angular_speed))

    def _neighbours(self, observation: Observation) -> list[Any]:
        people = zip(observation.people_position_m, observation.people_velocity_mps, strict=True)
        return [
            self._core.Neighbor(tuple(place), self._person_radius_m, tuple(velocity), number)
            for number, (place, velocity) in enumerate(people)
        ]


def _navground() -> Any:
    try:
        from navground import core
    except ImportError:
        raise SimError(
            f"planners {', '.join(BASELINES)} need the package navground, which is not installed; "
            "run: pip install navground"
        ) from None
    return core
