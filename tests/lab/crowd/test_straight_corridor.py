import numpy as np
import pytest

from lab.crowd.corridor_measures import corridor_of
from lab.crowd.straight_corridor import corridor_people
from serd_files.trajectories.read import Track

TIME_S = np.arange(0.0, 8.0, 0.1)


def walk(agent, *, y_m, sign=1, angle_rad=0.0, x_m=0.0, time_s=TIME_S):
    """10 m along the x axis, turned by an angle about the origin; 100 rows per agent."""
    along = sign * (1.25 * TIME_S - 5.0) + x_m
    places = np.stack([along, np.full_like(along, y_m)], axis=1)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    turned = places @ np.array([[cos, sin], [-sin, cos]])
    return Track(str(agent), time_s, turned, row=100 * agent + 1)


def two_way(n=12, **how):
    return [
        walk(i, y_m=y_m, sign=(-1) ** i, **how) for i, y_m in enumerate(np.linspace(-1.5, 1.5, n))
    ]


@pytest.mark.parametrize("angle_deg", [-80, -17, 40, 50])
def test_a_corridor_at_any_angle_has_the_width_of_one_along_an_axis(angle_deg):
    found = corridor_people(two_way(angle_rad=np.deg2rad(angle_deg)))
    corridor = corridor_of(found.tracks)
    straight = corridor_of(corridor_people(two_way()).tracks)
    assert found.axis == corridor.axis == (1 if abs(angle_deg) > 45 else 0)
    assert (corridor.width_m, corridor.flow) == (straight.width_m, "two ways")
    across = np.stack([track.position_m[:, 1 - found.axis] for track in found.tracks])
    np.testing.assert_allclose(np.ptp(across, axis=1), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    "elsewhere",
    [walk(20, y_m=40.0), walk(20, y_m=0.0, x_m=90.0), walk(20, y_m=-3.6)],
    ids=["across", "along", "near"],
)
def test_a_person_away_from_the_corridor_is_left_out_with_the_row(elsewhere):
    found = corridor_people([*two_way(), elsewhere])
    assert (len(found.tracks), found.n_apart) == (12, 1)
    assert found.remarks == (
        "agent 20, from row 2001, is more than 2 m away from all who walk in the corridor;"
        " left out",
    )
    assert corridor_of(found.tracks) == corridor_of(corridor_people(two_way()).tracks)
