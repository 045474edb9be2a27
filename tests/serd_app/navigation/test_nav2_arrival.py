"""Drives by goals of an action server that ends them within a tolerance, as Nav2's does.

The server, its robot and its clock are stand-ins in this process; the strategy is the product's.
"""

import math

import numpy as np
import pytest

from serd_app.navigation.nav2_goals import SUCCEEDED, Nav2Goals
from serd_app.navigation.navigator import Navigator
from serd_app.navigation.settings import NavigationSettings
from serd_files.model_file import load_model
from serd_sim.scenario.grid import grid_of, is_at_goal
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.epochs import epochs_in
from serd_sim.world.waypoint import (
    REPEAT_PERIOD_S,
    Waypoint,
    heading_to,
    waypoint_of_intent,
)
from support.changed_scenario import changed_scenario
from support.nav2_server import Nav2Server
from support.observations import observation_at

STEP_S, SPEED_MPS, TURN_RADPS = 0.05, 0.6, 1.5
#: A drive through the hallway and its corridor takes a minute.
LONGEST_S = 180.0


class Robot:
    """Drives to the goals of the server, one pose after the other, as a unicycle."""

    def __init__(self, server, tolerance_m, x_m, y_m):
        self.server, self.tolerance_m = server, tolerance_m
        self.pose, self.poses, self.handle, self.n_taken = [x_m, y_m, 0.0], [], None, 0

    def step(self):
        if len(self.server.goals) > self.n_taken:
            self.n_taken, self.poses = len(self.server.goals), list(self.server.goals[-1])
            self.handle = self.server.answer()
        while self.poses and math.dist(self.poses[0][:2], self.pose[:2]) <= self.tolerance_m:
            self.poses.pop(0)
        if self.poses:
            self.drive(*self.poses[0][:2])
        elif self.handle is not None:
            handle, self.handle = self.handle, None
            handle.end(SUCCEEDED)

    def drive(self, x_m, y_m):
        east_m, north_m = x_m - self.pose[0], y_m - self.pose[1]
        error = math.remainder(math.atan2(north_m, east_m) - self.pose[2], math.tau)
        self.pose[2] += max(-TURN_RADPS * STEP_S, min(TURN_RADPS * STEP_S, error))
        if abs(error) < 0.5:
            self.pose[0] += SPEED_MPS * STEP_S * math.cos(self.pose[2])
            self.pose[1] += SPEED_MPS * STEP_S * math.sin(self.pose[2])


def arrives(navigator, robot, goals, through, phase_s):
    """Whether the robot arrives in the goal cell; its pose is taken every 0.1 s."""
    strategy = navigator.strategy
    scenario, epochs = strategy.scenario, epochs_in(strategy.scenario)
    navigator.begin(0)
    waypoint, plan, due_s = None, [], 0.0
    for time_s in np.arange(phase_s, LONGEST_S, STEP_S):
        robot.step()
        x_m, y_m, yaw_rad = robot.pose
        seen = observation_at(x_m, y_m, yaw_rad=yaw_rad, time_s=float(time_s))
        if is_at_goal(scenario, scenario.goal_area_m, x_m, y_m):
            return True
        decides = epochs.begins(seen)
        if decides:
            action = navigator.decide(seen, epochs.state)
            epochs.take(float(time_s), action)
            waypoint = waypoint_of_intent(scenario.cells, seen, action)
            plan = [(*place, 0.0) for place in navigator.way_m(seen).tolist()]
        if decides or time_s >= due_s:
            due_s = time_s + REPEAT_PERIOD_S
            to = waypoint or Waypoint(x_m, y_m)
            targets = (plan[1:] or plan) if through else [(to.x_m, to.y_m, heading_to(to, seen))]
            goals.robot = tuple(robot.pose)
            goals.take(targets, float(time_s), float(time_s))
    return False


@pytest.mark.parametrize("through", [False, True])
@pytest.mark.parametrize("cell_size_m", [0.5, 1.0])
@pytest.mark.parametrize("tolerance_m", [0.05, 0.25, 0.5])
def test_nav2_reaches_every_goal_whatever_its_tolerance(
    tolerance_m, cell_size_m, through, save_model_of, tmp_path
):
    sized = {"cell_size_m: 1.0": f"cell_size_m: {cell_size_m}"}
    place = str(changed_scenario(tmp_path, "hallway", sized))
    settings = NavigationSettings(model=str(save_model_of(place)), timeout_s=LONGEST_S)
    navigator = Navigator(load_scenario(place), settings, waits_for_law=True)
    navigator.want_model(load_model(settings.model), settings.model)
    server, rng = Nav2Server(), np.random.default_rng(0)
    goals = Nav2Goals(server, lambda to, _: tuple(to), timeout_s=1.0, tolerance_m=tolerance_m)
    robot = Robot(server, tolerance_m, 1.5, 1.5)
    grid = grid_of(navigator.wanted.scenario)
    for goal in grid.centers_m[rng.permutation(grid.n_states)[:20]].tolist():
        navigator.want_goal(*goal)
        navigator.plan()
        assert arrives(navigator, robot, goals, through, rng.uniform(0.0, STEP_S)), (
            goal,
            robot.pose,
        )
        goals.cancel()
        robot.poses, robot.handle = [], None
