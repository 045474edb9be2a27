"""Dynamic window planner (Fox, Burgard & Thrun 1997) among walking people.

Every control period it rolls out the commands the robot can reach soon, throws away those that
would hit a wall or a person before the robot could have stopped, and takes the cheapest:

    cost = w_p mean_t d_t + w_s last distance + w_h |heading error|
           + w_n max_t nearness of people + w_w nearness of walls

with d_t the smallest distance to the waypoint up to t. Standing still is always allowed: a robot
that stands does not run into anybody.
"""

import math

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from sim.clearance import cannot_stop_before, gap_to_people_m, gap_to_walls_m
from sim.command import STOP, Command
from sim.dwa_settings import DwaSettings, reachable_window
from sim.nearby_people import predict_nearby
from sim.observation import Observation
from sim.occupancy import wall_distance_raster
from sim.rollouts import Rollouts, roll_out
from sim.scenario import Scenario
from sim.waypoint import Waypoint

_FORBIDDEN = 1e6
_REACTION_S = 0.3
_SLOWEST_MPS = 1e-3
_STANDS_MPS = 0.05
_STANDING = -1  # index of speed 0 among the sampled speeds


class DwaPlanner:
    """Drives to a waypoint around people and away from walls."""

    def __init__(self, scenario: Scenario, settings: DwaSettings | None = None) -> None:
        self.settings = settings if settings is not None else DwaSettings()
        self._robot = scenario.robot
        self._walls = wall_distance_raster(scenario)
        count, step_s = self.settings.n_steps, self.settings.time_granularity_s
        self._time_s: FloatArray = step_s * np.arange(1, count + 1, dtype=np.float64)
        spread = np.linspace(-1.0, 1.0, self.settings.vtheta_samples)
        self._turn_shares: FloatArray = np.sign(spread) * np.abs(spread) ** 1.5
        self._foresight: FloatArray = np.exp(-self._time_s / self.settings.foresight_s)
        self._is_blocked = False

    @property
    def is_blocked(self) -> bool:
        """Whether every way to move was forbidden when it was asked last."""
        return self._is_blocked

    def reset(self) -> None:
        """Nothing is remembered but whether the robot was blocked."""
        self._is_blocked = False

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
        self._is_blocked = False
        if waypoint is None:
            return STOP
        to_x, to_y = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
        distance_m = math.hypot(to_x, to_y)
        if distance_m < self.settings.xy_goal_tolerance_m:
            return STOP
        speeds, turns = self._samples(observation, distance_m)
        cost = self._cost(observation, waypoint, speeds, turns)
        moving = speeds > _SLOWEST_MPS
        self._is_blocked = bool(cost[moving].min(initial=np.inf) >= _FORBIDDEN)
        if self._is_blocked and abs(observation.speed_mps) < _STANDS_MPS:
            return self._turn_to_leave(observation, waypoint)
        best_v, best_w = np.unravel_index(int(np.argmin(cost)), cost.shape)
        return Command(float(speeds[best_v]), float(turns[best_w]))

    def _turn_to_leave(self, observation: Observation, waypoint: Waypoint) -> Command:
        """Turn on the spot towards the best way out; stay as it is where there is none."""
        settings, robot = self.settings, self._robot
        speeds = np.append(np.linspace(0.25, 1.0, 3) * robot.max_vel_x_mps, 0.0)
        turns = robot.max_vel_theta_radps * self._turn_shares
        cost = self._cost(observation, waypoint, speeds, turns, settings.leaving_turn_s)
        best_v, best_w = np.unravel_index(int(np.argmin(cost)), cost.shape)
        return Command(0.0, float(turns[best_w]) if speeds[best_v] > 0.0 else 0.0)

    def _cost(
        self,
        observation: Observation,
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
        to_x, to_y = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
        soon_s = _REACTION_S + turn_first_s
        cost = self._progress_cost(rollouts, waypoint)
        if turn_first_s == 0.0:
            cost += self._turning_cost(rollouts, turns, to_x, to_y)
        cost += self._wall_cost(rollouts, soon_s)
        cost += self._people_cost(rollouts, observation, soon_s)
        return cost

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

    def _progress_cost(self, rollouts: Rollouts, waypoint: Waypoint) -> FloatArray:
        """(V, W) mean over time of the smallest distance to the waypoint so far, and the last one.

        The smallest distance rewards speed; the last one keeps the robot at the waypoint.
        """
        away_x, away_y = rollouts.x_m - waypoint.x_m, rollouts.y_m - waypoint.y_m
        distance = np.sqrt(away_x * away_x + away_y * away_y)
        last = distance[:, :, -1].copy()
        np.minimum.accumulate(distance, axis=2, out=distance)
        cost: FloatArray = self.settings.progress_weight * distance.mean(axis=2)
        return cost + self.settings.staying_weight * last

    def _turning_cost(
        self, rollouts: Rollouts, turns: FloatArray, to_x: float, to_y: float
    ) -> FloatArray:
        """(1, W) for not facing the waypoint after the turn, and for turning fast."""
        error = np.arctan2(to_y, to_x) - rollouts.yaw_rad[:, -1]
        error = np.abs((error + np.pi) % (2.0 * np.pi) - np.pi)
        weight = self.settings.heading_weight * min(1.0, 2.0 * math.hypot(to_x, to_y))
        cost: FloatArray = weight * error + self.settings.turning_weight * np.abs(turns)
        return cost[None, :]

    def _wall_cost(self, rollouts: Rollouts, soon_s: float) -> FloatArray:
        """(V, W) nearness of walls; forbidden where the robot would touch one before it stops."""
        settings = self.settings
        reach_m = self._robot.radius_m + settings.wall_margin_m
        gap = gap_to_walls_m(rollouts.x_m, rollouts.y_m, self._walls, reach_m)
        nearness = np.exp(-np.maximum(gap.min(axis=2), 0.0) / settings.wall_decay_m)
        cost: FloatArray = settings.wall_weight * nearness
        return cost + _FORBIDDEN * self._hits(rollouts, gap < 0.0, soon_s)

    def _people_cost(
        self, rollouts: Rollouts, observation: Observation, soon_s: float
    ) -> FloatArray:
        """(V, W) nearness of people; forbidden where the robot would run into one.

        Being touched by somebody is no reason to stay: only what brings the robot nearer than
        standing still would is forbidden.
        """
        settings = self.settings
        people = predict_nearby(
            observation, settings.people_range_m, settings.max_people, self._time_s
        )
        if not len(people):
            return np.zeros(rollouts.x_m.shape[:2])
        reach_m = self._robot.radius_m + settings.person_radius_m
        gap = gap_to_people_m(rollouts.x_m, rollouts.y_m, people, reach_m)
        closer = gap < np.minimum(settings.person_margin_m, gap[_STANDING] - 1e-3)
        nearness = np.exp(-np.maximum(gap, -settings.people_decay_m) / settings.people_decay_m)
        cost: FloatArray = settings.people_weight * np.max(nearness * self._foresight, axis=2)
        return cost + _FORBIDDEN * self._hits(rollouts, closer, soon_s)

    def _hits(self, rollouts: Rollouts, too_close: BoolArray, soon_s: float) -> BoolArray:
        """(V, W) rollouts that come too close before they could stop and end up moving."""
        final_speed = rollouts.speed_mps[:, -1]
        soon = cannot_stop_before(final_speed, self._robot.acc_lim_x_mps2, self._time_s, soon_s)
        moving = np.abs(final_speed) > _SLOWEST_MPS
        found: BoolArray = (too_close & soon[:, None, :]).any(axis=2) & moving[:, None]
        return found
