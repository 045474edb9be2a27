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

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.planning.rollout_costs import CostSettings, RolloutCosts, Surroundings
from serd_sim.planning.rollouts import (
    REACTION_S,
    before_stop,
    reachable_window,
    require_foresight,
    roll_out,
    speed_to_stop_within,
)
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

_FORBIDDEN = 1e6
_SLOWEST_MPS = 1e-3
_STANDS_MPS = 0.05
#: Time (s) within which a sampled command must be reachable.
WINDOW_S = 0.3
#: How long (s) a sampled turn lasts before the rollout goes straight on.
_TURN_TIME_S = 0.4
#: How long (s) a blocked robot may turn in place before it drives on.
_LEAVING_TURN_S = 0.6
_TURNING_WEIGHT = 0.01


class DwaPlanner:
    """Drives to a waypoint around people and away from walls.

    approach_s: time constant (s) with which the chosen speed is approached, where that hits
    nothing; 0: as fast as the robot can. Samples are up to 0.2 m/s apart and move with the speed,
    so that the chosen one jumps from step to step.
    is_blocked: whether every motion was forbidden at the last step.
    """

    def __init__(self, scenario: Scenario, approach_s: float = 0.0) -> None:
        self._approach = min(1.0, scenario.control_period_s / approach_s) if approach_s else 1.0
        self._settings = scenario.local_planner
        self._robot = self._settings.limited(scenario.robot)
        step_s = self._settings.time_granularity
        count = max(2, round(self._settings.sim_time / step_s))
        require_foresight("local_planner.sim_time", count * step_s, self._robot)
        self._time_s: FloatArray = step_s * np.arange(1, count + 1, dtype=np.float64)
        self._costs = RolloutCosts(scenario, CostSettings(), self._time_s)
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
        speed, turn = float(speeds[best_v]), turns[best_w : best_w + 1]
        if self._approach < 1.0:
            way = self._approach * (speed - observation.speed_mps)
            nearer = np.array([min(max(observation.speed_mps + way, 0.0), float(speeds.max()))])
            if self._cost(observation, around, waypoint, nearer, turn)[0, 0] < _FORBIDDEN:
                speed = float(nearer[0])
        return Command(speed, float(turn[0]))

    def _samples(
        self, observation: Observation, distance_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """Speeds (V,) forward, slow enough to stop at the waypoint, the last one 0; turns (W,)."""
        robot = self._robot
        (slowest, fastest), (rightmost, leftmost) = reachable_window(
            robot, observation.speed_mps, observation.yaw_rate_radps, WINDOW_S
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
        soon = before_stop(
            rollouts.speed_mps[:, -1],
            self._robot,
            self._time_s,
            slowest_mps=_SLOWEST_MPS,
            reaction_s=REACTION_S + turn_first_s,
        )
        wall_cost, at_wall = self._costs.walls(x_m, y_m, around, soon.shape[1])
        people_cost, at_person = self._costs.people(x_m, y_m, around, soon.shape[1])
        hits: BoolArray = np.any((at_wall | at_person) & soon[:, None, :], axis=-1)
        cost = self._costs.progress(x_m, y_m, waypoint) + wall_cost + people_cost
        if turn_first_s == 0.0:
            to_x, to_y = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
            error_rad = math.atan2(to_y, to_x) - rollouts.yaw_rad[:, -1]
            facing = self._costs.heading(error_rad, math.hypot(to_x, to_y))
            cost += facing + _TURNING_WEIGHT * np.abs(turns)
        return cost + _FORBIDDEN * hits
