"""Dynamic window planner (Fox, Burgard & Thrun 1997) among walking people.

Every control period it rolls out the commands the robot can reach soon, forbids those that would
hit a wall or a person before the robot could have stopped, and takes the cheapest:

    cost = w_p mean_t d_t + w_s last distance + w_h |heading error|
           + w_n max_t nearness of people + w_w nearness of walls

with d_t the smallest distance to the waypoint up to t (`rollout_costs`). Standing still is always
allowed: a robot at rest does not run into people. When all motions are forbidden, it turns in place
towards the direction in which it will be able to leave.
"""

import math
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.errors import SimError
from serd_sim.planning.rollout_costs import RolloutCosts, Surroundings
from serd_sim.scenario.scenario import Scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import STOP, Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

#: Time (s) that passes before the robot brakes.
REACTION_S = 0.3
#: Share of the deceleration that planners count on for stopping at the waypoint.
BRAKING_SHARE = 0.7


def reachable_window(
    robot: RobotSettings, speed_mps: float, yaw_rate_radps: float, window_s: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Slowest and fastest speed, rightmost and leftmost turn that the robot can reach soon.

    The dynamic window (Fox, Burgard & Thrun 1997): limits of the robot and its accelerations.
    """
    change_v, change_w = robot.acc_lim_x_mps2 * window_s, robot.acc_lim_theta_radps2 * window_s
    most_w = robot.max_vel_theta_radps
    return (
        (
            max(robot.min_vel_x_mps, speed_mps - change_v),
            min(robot.max_vel_x_mps, speed_mps + change_v),
        ),
        (max(-most_w, yaw_rate_radps - change_w), min(most_w, yaw_rate_radps + change_w)),
    )


@dataclass(frozen=True, eq=False)
class Rollouts:
    """x_m, y_m: (V, W, T) positions; speed_mps: (V, T); yaw_rad: (W, T)."""

    x_m: FloatArray
    y_m: FloatArray
    speed_mps: FloatArray
    yaw_rad: FloatArray


def ramp(start: float, wanted: FloatArray, limit: float, time_s: FloatArray) -> FloatArray:
    """(n, T) values that go from `start` to each wanted one at the limited rate."""
    reach = limit * time_s
    change: FloatArray = np.minimum(np.maximum((wanted - start)[:, None], -reach), reach)
    return start + change


def roll_out(
    pose: tuple[float, float, float],
    speeds: tuple[float, FloatArray],
    turns: tuple[float, FloatArray],
    robot: RobotSettings,
    time_s: FloatArray,
    turn_time_s: float,
    start_s: float = 0.0,
) -> Rollouts:
    """Rollouts from a pose; `speeds` and `turns` are the present value and the sampled ones.

    start_s: how long the present speed is kept before the ramp to the sampled one.
    """
    step_s = time_s[0]
    middle_s = time_s - 0.5 * step_s
    speed = ramp(speeds[0], speeds[1], robot.acc_lim_x_mps2, np.maximum(middle_s - start_s, 0.0))
    turning = ramp(turns[0], turns[1], robot.acc_lim_theta_radps2, middle_s)
    turning = np.where(middle_s > turn_time_s, 0.0, turning)
    yaw = pose[2] + step_s * turning.cumsum(axis=1)
    middle_yaw = yaw - 0.5 * step_s * turning
    x_m = _positions(pose[0], speed, np.cos(middle_yaw), step_s)
    y_m = _positions(pose[1], speed, np.sin(middle_yaw), step_s)
    return Rollouts(x_m=x_m, y_m=y_m, speed_mps=speed, yaw_rad=yaw)


def _positions(
    start_m: float, speed_mps: FloatArray, direction: FloatArray, step_s: float
) -> FloatArray:
    """(V, W, T) one coordinate; direction: (W, T) that of unit vectors along the motion."""
    way: FloatArray = (speed_mps[:, None, :] * direction).cumsum(axis=2)
    way *= step_s
    way += start_m
    return way


def speed_to_stop_within(distance_m: float, robot: RobotSettings) -> float:
    """Largest speed (m/s) from which the robot stops within a distance: v^2 = 2 a d."""
    return float(np.sqrt(2.0 * BRAKING_SHARE * robot.acc_lim_x_mps2 * distance_m))


def before_stop(
    speed_mps: FloatArray,
    robot: RobotSettings,
    time_s: FloatArray,
    *,
    slowest_mps: float,
    reaction_s: float = REACTION_S,
) -> BoolArray:
    """(N, n) which of the (T,) times come before a robot at each of (N,) speeds has stopped.

    None do at speeds of up to slowest_mps. The columns end with the last one that holds a time.
    """
    fast_mps = np.abs(speed_mps)
    stopping_s = fast_mps / robot.acc_lim_x_mps2 + reaction_s
    stopping_s[fast_mps <= slowest_mps] = -1.0
    n_columns = time_s.searchsorted(stopping_s.max(initial=-1.0), side="right")
    before: BoolArray = time_s[:n_columns] <= stopping_s[:, None]
    return before


_FORBIDDEN = 1e6
_SLOWEST_MPS = 1e-3
_STANDS_MPS = 0.05
#: Time (s) within which a sampled command must be reachable.
_WINDOW_S = 0.3
#: How long (s) a sampled turn lasts before the rollout goes straight on.
_TURN_TIME_S = 0.4
#: How long (s) a blocked robot may turn in place before it drives on.
_LEAVING_TURN_S = 0.6
_TURNING_WEIGHT = 0.01


class DwaPlanner:
    """Drives to a waypoint around people and away from walls.

    is_blocked: whether every motion was forbidden at the last step.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._settings = scenario.local_planner
        self._robot = self._settings.limited(scenario.robot)
        step_s = self._settings.time_granularity
        count = max(2, round(self._settings.sim_time / step_s))
        horizon_s, robot = count * step_s, self._robot
        stopping_s = robot.max_vel_x_mps / robot.acc_lim_x_mps2 + REACTION_S
        if horizon_s < stopping_s:
            raise SimError(
                f"local_planner.sim_time must be at least {stopping_s:.3g} s, in which the robot"
                f" stops from its fastest ({robot.max_vel_x_mps:g} m/s at"
                f" {robot.acc_lim_x_mps2:g} m/s2), got {horizon_s:g} s; raise it or lower"
                " local_planner.max_vel_x"
            )
        self._time_s: FloatArray = step_s * np.arange(1, count + 1, dtype=np.float64)
        self._costs = RolloutCosts(scenario, self._time_s)
        spread = np.linspace(-1.0, 1.0, self._settings.vtheta_samples)
        self._turn_shares: FloatArray = np.sign(spread) * np.abs(spread) ** 1.5
        self.is_blocked = False

    def reset(self) -> None:
        """Clear `is_blocked`, the only state."""
        self.is_blocked = False

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
        self.is_blocked = False
        if waypoint is None:
            return STOP
        distance_m = math.hypot(waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m)
        if distance_m < self._settings.xy_goal_tolerance:
            return STOP
        speeds, turns = self._samples(observation, distance_m)
        around = self._costs.look(observation)
        cost = self._cost(observation, around, waypoint, speeds, turns)
        moving = speeds > _SLOWEST_MPS
        self.is_blocked = bool(cost[moving].min(initial=np.inf) >= _FORBIDDEN)
        if self.is_blocked and abs(observation.speed_mps) < _STANDS_MPS:
            return self._turn_to_leave(observation, around, waypoint)
        best_v, best_w = divmod(int(cost.argmin()), len(turns))
        return Command(float(speeds[best_v]), float(turns[best_w]))

    def _samples(
        self, observation: Observation, distance_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """Speeds (V,) forward, slow enough to stop at the waypoint, the last one 0; turns (W,)."""
        robot = self._robot
        (slowest, fastest), (rightmost, leftmost) = reachable_window(
            robot, observation.speed_mps, observation.yaw_rate_radps, _WINDOW_S
        )
        fastest = max(min(fastest, speed_to_stop_within(distance_m, robot)), 0.0)
        slowest = min(max(slowest, 0.0), fastest)
        moving = np.linspace(slowest, fastest, self._settings.vx_samples - 1)
        speeds = np.concatenate([moving, [0.0]])
        half, middle = 0.5 * (leftmost - rightmost), 0.5 * (leftmost + rightmost)
        return speeds, middle + half * self._turn_shares

    def _turn_to_leave(
        self, observation: Observation, around: Surroundings, waypoint: Waypoint
    ) -> Command:
        """Turn in place towards the best way out; stand still where there is none."""
        speeds = np.append(np.linspace(0.25, 1.0, 3) * self._robot.max_vel_x_mps, 0.0)
        turns = self._robot.max_vel_theta_radps * self._turn_shares
        cost = self._cost(observation, around, waypoint, speeds, turns, _LEAVING_TURN_S)
        best_v, best_w = divmod(int(cost.argmin()), len(turns))
        return Command(0.0, float(turns[best_w]) if speeds[best_v] > 0.0 else 0.0)

    def _cost(
        self,
        observation: Observation,
        around: Surroundings,
        waypoint: Waypoint,
        speeds: FloatArray,
        turns: FloatArray,
        turn_first_s: float = 0.0,
    ) -> FloatArray:
        """(V, W) cost of commands, at least _FORBIDDEN where they would hit something.

        turn_first_s: when above zero, the robot turns in place for so long before it drives on.
        """
        rollouts = roll_out(
            observation.pose,
            (observation.speed_mps, speeds),
            (observation.yaw_rate_radps, turns),
            self._robot,
            self._time_s,
            max(_TURN_TIME_S, turn_first_s),
            turn_first_s,
        )
        x_m, y_m = rollouts.x_m, rollouts.y_m
        robot = self._robot
        # The turn of a round robot sweeps over nothing else.
        turns_s = robot.max_vel_theta_radps / robot.acc_lim_theta_radps2
        soon = before_stop(
            rollouts.speed_mps[:, -1],
            robot,
            self._time_s,
            slowest_mps=_SLOWEST_MPS if robot.outline.is_round else -1.0,
            reaction_s=REACTION_S + turn_first_s + (0.0 if robot.outline.is_round else turns_s),
        )
        wall_cost, at_wall = self._costs.walls(x_m, y_m, around, soon.shape[1], rollouts.yaw_rad)
        people_cost, at_person = self._costs.people(
            x_m, y_m, around, soon.shape[1], rollouts.yaw_rad
        )
        hits: BoolArray = np.any((at_wall | at_person) & soon[:, None, :], axis=-1)
        cost = self._costs.progress(x_m, y_m, waypoint) + wall_cost + people_cost
        if turn_first_s == 0.0:
            to_x, to_y = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
            error_rad = math.atan2(to_y, to_x) - rollouts.yaw_rad[:, -1]
            facing = self._costs.heading(error_rad, math.hypot(to_x, to_y))
            cost += facing + _TURNING_WEIGHT * np.abs(turns)
        return cost + _FORBIDDEN * hits
