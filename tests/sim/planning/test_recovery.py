"""Progress check, recoveries and status."""

from sim.planning.local_planner import PlannerStatus
from sim.planning.recovery import ProgressChecker, RecoveringPlanner
from sim.scenario.scenario import load_scenario
from sim.world.command import STOP, Command
from sim.world.waypoint import Waypoint
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
AHEAD = Waypoint(3.0, 10.0)


class PushingPlanner:
    """Always drives on; reports the given is_blocked."""

    def __init__(self, is_blocked=False):
        self.is_blocked = is_blocked

    def reset(self):
        pass

    def step(self, _observation, waypoint):
        return STOP if waypoint is None else Command(0.5, 0.0)


def standing_at(time_s, x_m=3.0, y_m=8.0, yaw_rad=0.0, people=()):
    return observation_at(x_m, y_m, yaw_rad, time_s=time_s, people=people)


def commands_while_stuck(planner, duration_s, **place):
    return [
        planner.step(standing_at(0.05 * tick, **place), AHEAD)
        for tick in range(round(duration_s / 0.05))
    ]


def test_a_robot_that_moves_is_never_stuck_and_one_that_stands_is_after_the_allowance():
    checker = ProgressChecker(0.5, 10.0)
    assert not any(checker.is_stuck(standing_at(t, y_m=8.0 + 0.1 * t)) for t in range(60))
    checker.reset()
    stuck = [checker.is_stuck(standing_at(float(t))) for t in range(13)]
    assert stuck == [False] * 11 + [True, True]


def test_a_stuck_robot_backs_off_then_turns_then_waits():
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    commands = commands_while_stuck(planner, 40.0)
    recoveries = [
        c for k, c in enumerate(commands) if c != Command(0.5, 0.0) and commands[k - 1] != c
    ]
    assert recoveries == [Command(-0.15, 0.0), Command(0.0, 1.5), STOP]


def test_a_stuck_robot_does_not_back_off_into_a_wall_or_a_person():
    at_wall = RecoveringPlanner(PushingPlanner(), HALLWAY)
    assert min(c.linear_mps for c in commands_while_stuck(at_wall, 14.0, x_m=0.3)) >= 0.0
    leaned_on = RecoveringPlanner(PushingPlanner(), HALLWAY)
    commands = commands_while_stuck(leaned_on, 14.0, people=[(2.4, 8.0)])
    assert min(c.linear_mps for c in commands) >= 0.0


def test_the_status_names_the_reason_of_a_failure():
    planner = RecoveringPlanner(PushingPlanner(is_blocked=True), HALLWAY)
    reported = []
    for tick in range(1200):
        planner.step(standing_at(0.05 * tick), AHEAD)
        reported.append(planner.status)
    order = [s for k, s in enumerate(reported) if k == 0 or reported[k - 1] != s]
    assert order == [
        PlannerStatus.NO_VALID_CONTROL,
        PlannerStatus.PATIENCE_EXCEEDED,
        PlannerStatus.FAILED_TO_MAKE_PROGRESS,
    ]


class StandingPlanner(PushingPlanner):
    """Sees ways to go but finds standing best, as in a dead end."""

    def step(self, _observation, _waypoint):
        return STOP


def test_a_robot_that_stands_short_of_its_waypoint_recovers_and_one_that_is_there_does_not():
    short = RecoveringPlanner(StandingPlanner(), HALLWAY)
    commands_while_stuck(short, 60.0)
    assert short.n_recoveries > 3
    assert short.status == PlannerStatus.FAILED_TO_MAKE_PROGRESS
    there = RecoveringPlanner(StandingPlanner(), HALLWAY)
    commands_while_stuck(there, 60.0, y_m=AHEAD.y_m - 0.1)
    assert (there.n_recoveries, there.status) == (0, PlannerStatus.NONE)


def test_a_robot_without_a_waypoint_is_not_stuck():
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    for tick in range(600):
        assert planner.step(standing_at(0.05 * tick), None) == STOP
    assert planner.status == PlannerStatus.NONE
    assert planner.n_recoveries == 0
