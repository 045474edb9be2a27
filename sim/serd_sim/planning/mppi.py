"""Model predictive path integral planner (Williams et al., ICRA 2016) among walking people.

It keeps a plan of accelerations (T, 2). Each control period it adds noise to it N times, rolls the
N plans out under the robot's limits, and averages them with weights

    w_n ~ exp(-(S_n - min S) / temperature)

where S_n is the cost of the rollout: distance to the waypoint, nearness of people and of walls. A
plan that would hit a person or a wall before the robot could stop costs so much that it has no
weight; when the average is such a plan, the best sample is driven instead, or the robot stops.
"""

import math

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.planning.rollout_costs import CostSettings, RolloutCosts, Surroundings
from serd_sim.planning.rollouts import before_stop, require_foresight, speed_to_stop_within
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

_FORBIDDEN = 1e4
_SLOWEST_MPS = 0.02
#: Steps over which a sampled acceleration is held.
_NOISE_HOLD_STEPS = 2
_SEED = 1
_COSTS = CostSettings(staying_weight=0.5, people_weight=1.0)


class MppiPlanner:
    """Drives to a waypoint by averaging many random plans.

    is_blocked: whether every motion was forbidden at the last step. plan: (2, T) accelerations.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._settings = scenario.local_planner
        self._robot = self._settings.limited(scenario.robot)
        self._control_period_s = scenario.control_period_s
        steps, step_s = self._settings.time_steps, self._settings.model_dt
        horizon = "local_planner.time_steps times model_dt"
        require_foresight(horizon, steps * step_s, self._robot)
        self._time_s: FloatArray = step_s * np.arange(1, steps + 1, dtype=np.float64)
        self._costs = RolloutCosts(scenario, _COSTS, self._time_s)
        self.reset()

    def reset(self) -> None:
        """Discard the plan and seed the random numbers again."""
        self.is_blocked = False
        self._rng = np.random.default_rng(_SEED)
        self.plan: FloatArray = np.zeros((2, self._settings.time_steps))

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
        self.is_blocked = False
        at = waypoint or observation
        distance_m = math.hypot(at.x_m - observation.x_m, at.y_m - observation.y_m)
        if waypoint is None or distance_m < self._settings.xy_goal_tolerance:
            self.plan[:] = 0.0
            return STOP
        speed, turning = self._limited(observation, self._sampled_plans(), distance_m)
        around = self._costs.look(observation)
        cost = self._cost(observation, around, waypoint, speed, turning)
        moving = speed[:, 0] > _SLOWEST_MPS
        self.is_blocked = bool(cost[moving].min(initial=np.inf) >= _FORBIDDEN)
        weight = np.exp(-(cost - cost.min()) / self._settings.temperature)
        weight /= weight.sum()
        # einsum, not BLAS: the sum's order must not depend on the number of threads.
        mean_speed, mean_turning = np.einsum("n,knt->kt", weight, np.stack([speed, turning]))
        mean_cost = self._cost(observation, around, waypoint, mean_speed[None], mean_turning[None])
        if mean_cost[0] >= _FORBIDDEN:
            best = int(np.argmin(cost))
            mean_speed, mean_turning = speed[best], turning[best]
            if cost[best] >= _FORBIDDEN:
                self.plan[:] = 0.0
                return Command(0.0, float(mean_turning[0]))
        self._keep_plan(observation, mean_speed, mean_turning)
        return Command(float(mean_speed[0]), float(mean_turning[0]))

    def _sampled_plans(self) -> FloatArray:
        """(2, N, T) accelerations: the last plan with noise that is held over a few steps.

        The first sample is the plan itself, the second one brakes.
        """
        settings = self._settings
        n_draws = -(-settings.time_steps // _NOISE_HOLD_STEPS)
        noise = self._rng.standard_normal((2, settings.batch_size, n_draws))
        noise = np.repeat(noise, _NOISE_HOLD_STEPS, axis=2)[:, :, : settings.time_steps]
        noise *= np.array([settings.vx_std, settings.wz_std])[:, None, None]
        noise[:, :2] = 0.0
        plans: FloatArray = noise + self.plan[:, None, :]
        plans[0, 1] = -self._robot.acc_lim_x_mps2
        return plans

    def _limited(
        self, observation: Observation, plans: FloatArray, distance_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """(N, T) speeds and turning rates of the plans under the robot's limits.

        A clipped ramp is never steeper than the ramp, so the accelerations stay within limits too.
        """
        robot, step_s = self._robot, self._settings.model_dt
        limits = robot.acc_lim_x_mps2, robot.acc_lim_theta_radps2
        change_v = step_s * np.cumsum(np.clip(plans[0], -limits[0], limits[0]), axis=1)
        change_w = step_s * np.cumsum(np.clip(plans[1], -limits[1], limits[1]), axis=1)
        fastest = min(robot.max_vel_x_mps, speed_to_stop_within(distance_m, robot))
        speed = np.clip(observation.speed_mps + change_v, 0.0, fastest)
        fastest_turn = robot.max_vel_theta_radps
        turning = np.clip(observation.yaw_rate_radps + change_w, -fastest_turn, fastest_turn)
        return speed, turning

    def _cost(
        self,
        observation: Observation,
        around: Surroundings,
        waypoint: Waypoint,
        speed: FloatArray,
        turning: FloatArray,
    ) -> FloatArray:
        """(N,) cost of rollouts with (N, T) speeds and turning rates."""
        step_s = self._settings.model_dt
        yaw = observation.yaw_rad + step_s * np.cumsum(turning, axis=1)
        middle_yaw = yaw - 0.5 * step_s * turning
        x_m = observation.x_m + step_s * np.cumsum(speed * np.cos(middle_yaw), axis=1)
        y_m = observation.y_m + step_s * np.cumsum(speed * np.sin(middle_yaw), axis=1)
        to_x, to_y = waypoint.x_m - x_m[:, -1], waypoint.y_m - y_m[:, -1]
        heading_error = np.arctan2(to_y, to_x) - yaw[:, -1]
        soon = before_stop(speed[:, 0], self._robot, self._time_s, slowest_mps=_SLOWEST_MPS)
        wall_cost, at_wall = self._costs.walls(x_m, y_m, around, soon.shape[1])
        people_cost, at_person = self._costs.people(x_m, y_m, around, soon.shape[1])
        cost = self._costs.progress(x_m, y_m, waypoint) + wall_cost + people_cost
        cost += self._costs.heading(heading_error, np.hypot(to_x, to_y))
        hits: BoolArray = np.any((at_wall | at_person) & soon, axis=-1)
        return cost + _FORBIDDEN * hits

    def _keep_plan(self, observation: Observation, speed: FloatArray, turning: FloatArray) -> None:
        """Keep the accelerations of the driven speeds, moved on by one control period."""
        step_s = self._settings.model_dt
        speeds = np.stack([speed, turning])
        start = np.array([[observation.speed_mps], [observation.yaw_rate_radps]])
        plan = np.diff(speeds, axis=1, prepend=start) / step_s
        share, whole = math.modf(self._control_period_s / step_s)
        whole_steps = min(int(whole), plan.shape[1])
        later = np.append(plan[:, whole_steps:], np.zeros((2, whole_steps + 1)), axis=1)
        self.plan = (1.0 - share) * later[:, :-1] + share * later[:, 1:]
