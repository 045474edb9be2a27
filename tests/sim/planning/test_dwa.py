"""Parts of the dynamic window planner."""

import numpy as np
import pytest

from serd_sim.planning.catalogue import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
AHEAD = Waypoint(3.0, 9.0)


def commands(observation):
    """Those of both kinds of the planner."""
    return [make_planner(name, HALLWAY).step(observation, AHEAD) for name in ("dwa", "dwa_smooth")]


@pytest.mark.parametrize("speed_mps", [0.0, 0.3, 0.8, 1.2])
@pytest.mark.parametrize("y_m", [2.0, 6.0, 8.4])
def test_the_smooth_planner_drives_a_sixth_of_the_way_to_the_chosen_speed(speed_mps, y_m):
    """Its time constant of 0.3 s is six control periods; it brakes at the waypoint as the other."""
    seen = observation_at(3.0, y_m, yaw_rad=np.pi / 2, speed_mps=speed_mps)
    direct, smooth = commands(seen)
    expected = speed_mps + (direct.linear_mps - speed_mps) / 6.0
    if y_m < 8.0:
        assert smooth.linear_mps == pytest.approx(expected)
    assert smooth.linear_mps <= max(expected, direct.linear_mps) + 1e-12
    assert smooth.angular_radps == direct.angular_radps


def test_the_smooth_planner_brakes_at_once_where_a_slower_approach_would_hit_a_person():
    seen = observation_at(
        3.0, 6.0, yaw_rad=np.pi / 2, speed_mps=1.2, people=((2.7, 7.0), (3.3, 7.0))
    )
    direct, smooth = commands(seen)
    assert direct.linear_mps < 0.5
    assert smooth == direct
