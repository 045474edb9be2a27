"""Dynamic window planner (Fox, Burgard & Thrun 1997) among walking people.

Every control period it rolls out the commands the robot can reach soon, throws away those that
would hit a wall or a person before the robot could have stopped, and takes the cheapest:

    cost = w_p mean_t d_t + w_s last distance + w_h |heading error|
           + w_n max_t nearness of people + w_w nearness of walls

with d_t the smallest distance to the waypoint up to t (`rollout_costs`). Standing still is always
allowed: a robot that stands does not run into anybody. Blocked on all sides, it turns on the spot
towards where there will be a way out.
"""

import math

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from sim.planning.clearance import cannot_stop_before, up_to_last
from sim.planning.dwa_settings import DwaSettings, reachable_window
from sim.planning.rollout_costs import PeopleAround, RolloutCosts
from sim.planning.rollouts import Rollouts, roll_out
from sim.planning.stopping import REACTION_S, require_foresight
from sim.scenario.scenario import Scenario
from sim.world.command import STOP, Command
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint

_FORBIDDEN = 1e6
_SLOWEST_MPS = 1e-3
_STANDS_MPS = 0.05


class DwaPlanner:
    """Drives to a waypoint around people and away from walls."""

    def __init__(self, scenario: Scenario, settings: DwaSettings | None = None) -> None:
        parameters = scenario.local_planner
        self.settings = settings if settings is not None else parameters.dwa
        self._robot = parameters.limited(scenario.robot)
        count, step_s = self.settings.n_steps, self.settings.time_granularity_s
        require_foresight("local_planner.sim_time", count * step_s, self._robot)
        self._time_s: FloatArray = step_s * np.arange(1, count + 1, dtype=np.float64)
        self._costs = RolloutCosts(scenario, self.settings.costs, self._time_s)
        spread = np.linspace(-1.0, 1.0, self.settings.vtheta_samples)
        self._turn_shares: FloatArray = np.sign(spread) * np.abs(spread) ** 1.5
        self._is_blocked = False

    @property
    def is_blocked(self) -> bool:
        """Whether every way to move was forbidden when it was asked last."""
        return self._is_blocked

    def reset(self) -> None:
        """Nothing is remembered but whether the robot was blocked."""
        self._is_blocked = False

    def snapshot(self) -> bool:
        """All that changes: whether the robot was blocked."""
        return self._is_blocked

    def restore(self, state: bool) -> None:
        """Go back to a snapshot."""
        self._is_blocked = state

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
        self._is_blocked = False
        if waypoint is None:
            return STOP
        distance_m = math.hypot(waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m)
        if distance_m < self.settings.xy_goal_tolerance_m:
            return STOP
        speeds, turns = self._samples(observation, distance_m)
        around = self._costs.look(observation)
        cost = self._cost(observation, around, waypoint, speeds, turns)
        moving = speeds > _SLOWEST_MPS
        self._is_blocked = bool(cost[moving].min(initial=np.inf) >= _FORBIDDEN)
        if self._is_blocked and abs(observation.speed_mps) < _STANDS_MPS:
            return self._turn_to_leave(observation, around, waypoint)
        best_v, best_w = np.unravel_index(int(np.argmin(cost)), cost.shape)
        return Command(float(speeds[best_v]), float(turns[best_w]))

    def _samples(
        self, observation: Observation, distance_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """Speeds (V,) forward, slow enough to stop at the waypoint, the last one 0; turns (W,)."""
        robot, settings = self._robot, self.settings
        window = reachable_window(
            robot, observation.speed_mps, observation.yaw_rate_radps, settings.window_s
        )
        stopping = math.sqrt(2.0 * settings.braking_share * robot.acc_lim_x_mps2 * distance_m)
        fastest = max(min(window.fastest_mps, stopping), 0.0)
        slowest = min(max(window.slowest_mps, 0.0), fastest)
        speeds = np.append(np.linspace(slowest, fastest, settings.vx_samples - 1), 0.0)
        half = 0.5 * (window.leftmost_radps - window.rightmost_radps)
        middle = 0.5 * (window.leftmost_radps + window.rightmost_radps)
        return speeds, middle + half * self._turn_shares

    def _turn_to_leave(
        self, observation: Observation, around: PeopleAround, waypoint: Waypoint
    ) -> Command:
        """Turn on the spot towards the best way out; stay as it is where there is none."""
        settings, robot = self.settings, self._robot
        speeds = np.append(np.linspace(0.25, 1.0, 3) * robot.max_vel_x_mps, 0.0)
        turns = robot.max_vel_theta_radps * self._turn_shares
        cost = self._cost(observation, around, waypoint, speeds, turns, settings.leaving_turn_s)
        best_v, best_w = np.unravel_index(int(np.argmin(cost)), cost.shape)
        return Command(0.0, float(turns[best_w]) if speeds[best_v] > 0.0 else 0.0)

    def _cost(
        self,
        observation: Observation,
        around: PeopleAround,
        waypoint: Waypoint,
        speeds: FloatArray,
        turns: FloatArray,
        turn_first_s: float = 0.0,
    ) -> FloatArray:
        """(V, W) cost of commands, _FORBIDDEN and more where they would hit something.

        turn_first_s: above zero, of turning on the spot for so long before driving on.
        """
        rollouts = roll_out(
            observation.pose,
            (observation.speed_mps, speeds),
            (observation.yaw_rate_radps, turns),
            self._robot,
            self._time_s,
            max(self.settings.turn_time_s, turn_first_s),
            turn_first_s,
        )
        x_m, y_m = rollouts.x_m, rollouts.y_m
        soon = self._soon(rollouts, REACTION_S + turn_first_s)
        wall_cost, at_wall = self._costs.walls(x_m, y_m, soon.shape[1])
        people_cost, at_person = self._costs.people(x_m, y_m, around, soon.shape[1])
        hits = ((at_wall | at_person) & soon[:, None, :]).any(axis=2)
        cost = self._costs.progress(x_m, y_m, waypoint) + wall_cost + people_cost
        if turn_first_s == 0.0:
            cost += self._turning_cost(observation, waypoint, rollouts, turns)
        return cost + _FORBIDDEN * hits

    def _turning_cost(
        self,
        observation: Observation,
        waypoint: Waypoint,
        rollouts: Rollouts,
        turns: FloatArray,
    ) -> FloatArray:
        """(1, W) for not facing the waypoint after the turn, and for turning fast."""
        to_x, to_y = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
        error = math.atan2(to_y, to_x) - rollouts.yaw_rad[:, -1]
        facing = self._costs.heading(error, math.hypot(to_x, to_y))
        cost: FloatArray = facing + self.settings.turning_weight * np.abs(turns)
        return cost[None, :]

    def _soon(self, rollouts: Rollouts, soon_s: float) -> BoolArray:
        """(V, n_soon) times before which a rollout that ends up moving cannot stop."""
        final_speed = rollouts.speed_mps[:, -1]
        soon = cannot_stop_before(final_speed, self._robot.acc_lim_x_mps2, self._time_s, soon_s)
        soon &= (np.abs(final_speed) > _SLOWEST_MPS)[:, None]
        return up_to_last(soon)
