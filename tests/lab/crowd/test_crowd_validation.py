"""The crowd against measured ones: Weidmann, RiMEA, lanes, and a real corridor."""

from itertools import islice

import numpy as np
import pytest
import shapely

from lab.crowd.corridor_measures import Corridor, measure_recording
from lab.crowd.meetings import ROBOT, head_on, meetings_row, recorded_moments, simulated_moments
from lab.crowd.ring_corridor import ring_corridor_crowd, weidmann_speed_mps
from lab.crowd.straight_corridor import corridor_people
from serd_files.trajectories.read import Track
from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import model_named
from serd_sim.scenario.polygon import contains, edges_of


def mean_speed_mps(crowd, settle_steps=400, steps=600):
    speeds = []
    for step in range(settle_steps + steps):
        crowd.step(0.05)
        if step >= settle_steps:
            speeds.append(np.hypot(crowd.velocity_x_mps, crowd.velocity_y_mps).mean())
    return float(np.mean(speeds))


@pytest.mark.parametrize("density_pm2", [0.5, 1.0, 1.5])
def test_walking_speed_falls_with_density_as_weidmann_measured(density_pm2):
    walked_mps = []
    for seed in (1, 2, 3):
        place = {"width_m": 4.0, "length_m": 20.0, "density_pm2": density_pm2}
        walked_mps.append(
            mean_speed_mps(ring_corridor_crowd(**place, rng=np.random.default_rng(seed)))
        )
    assert np.mean(walked_mps) == pytest.approx(float(weidmann_speed_mps(density_pm2)), abs=0.15)


def lane_order(across_m, along_mps, strip_m=0.4):
    """Order of two-way traffic in lanes (Rex & Löwen, Physical Review E 75, 2007).

    phi_i = ((n_same - n_opposite) / (n_same + n_opposite))^2 over the people in the same strip
    along the way; the order is the mean of phi_i, 1 for perfect lanes.
    """
    same_strip = np.abs(across_m[:, None] - across_m[None, :]) < strip_m
    agreement = np.sign(along_mps)[:, None] * np.sign(along_mps)[None, :]
    share = np.sum(same_strip * agreement, axis=1) / np.sum(same_strip, axis=1)
    return float(np.mean(share**2))


def test_people_who_walk_both_ways_sort_into_lanes_better_than_chance():
    orders, baselines = [], []
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        crowd = ring_corridor_crowd(
            width_m=4.0, length_m=20.0, density_pm2=0.5, share_backwards=0.5, rng=rng
        )
        for step in range(1200):
            crowd.step(0.05)
            if step >= 600 and step % 60 == 0:
                orders.append(lane_order(crowd.y_m, crowd.velocity_x_mps))
                for _ in range(20):
                    shuffled = rng.permutation(crowd.velocity_x_mps)
                    baselines.append(lane_order(crowd.y_m, shuffled))
    assert np.mean(orders) > 2.0 * np.mean(baselines)
    assert lane_order(np.array([1.0, 1.1, 3.0, 3.1]), np.array([1.0, 1.2, -1.0, -0.9])) == 1.0


@pytest.mark.parametrize(
    ("model", "n_arrive"), [("collision_prediction", 20), ("helbing_molnar_1995", 15)]
)
def test_twenty_people_go_round_a_corner_and_nobody_through_the_wall(model, n_arrive):
    """RiMEA test 6: a corner between corridors 2 m wide; nothing is fitted in the model of 1995."""
    outline = np.array([[0, 0], [12, 0], [12, 12], [10, 12], [10, 2], [0, 2.0]])
    rng = np.random.default_rng(3)
    lanes = rng.uniform(0.4, 1.6, 20)
    ways = [np.array([[0.3, y], [12 - y, y], [12 - y, 30.0], [0.3, 30.0]]) for y in lanes]
    routes = Routes(ways)
    routes.place(np.zeros(20))
    crowd = Crowd(
        model=model_named(model),
        routes=routes,
        x_m=0.3 + 0.3 * rng.permutation(20),
        y_m=lanes,
        desired_speed_mps=np.full(20, 1.34),
        walls_m=edges_of(outline)[[0, 1, 3, 4, 5]],
        fluctuation_mps2=0.1,
        rng=rng,
    )
    for _ in range(600):
        crowd.step(0.05)
        inside = contains(outline, np.stack([crowd.x_m, crowd.y_m], axis=1))
        assert (inside | (crowd.y_m > 11.9)).all()
    assert (crowd.y_m > 11.9).sum() >= n_arrive


def measured(frame):
    """Two people pass each other at 1 m/s, 0.8 m apart; one of them is recorded twice."""
    along_m = (np.arange(150.0) - 75.0) / 25.0
    tracks = [
        Track(f"{side} {sign}", frame / 25.0, np.stack([sign * along_m, 0 * along_m + side], 1))
        for sign, side in ((1.0, 0.4), (-1.0, -0.4), (1.0, 0.4))
    ]
    return measure_recording(tracks, Corridor(0, (0.0, 0.0), 4.0))


def test_measures_of_a_recording_made_by_hand():
    """They share the corridor up to 0.1 m beyond the farthest place, 3.08 m to either side."""
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    measures = measured(np.arange(150.0))
    assert measures.density_pm2 == pytest.approx(2 / (4.0 * 2 * 3.1), rel=1e-6)
    assert measures.speed_mps == pytest.approx(1.0)
    assert measures.person_speed_mps == pytest.approx(1.0)
    assert measures.passing_distance_m.min() == pytest.approx(0.8)
    assert measures.nearest_m.min() == pytest.approx(0.8)
    # Half frames were rounded to even ones, so that people were twice in these.
    later = measured(np.arange(150.0) + 0.5)
    np.testing.assert_allclose(later.density_pm2, measures.density_pm2)


def test_who_meets_head_on_is_measured_when_passing():
    """Two walk at 1 m/s, 0.2 m apart, and move aside by 0.3 and 0.1 m; a third is 1 m beside."""
    along_m = np.arange(-100.0, 100.0) / 25.0
    aside_m = np.clip(along_m + 1.0, 0.0, 1.0)
    ways = [
        (along_m, 0.3 * aside_m),
        (-along_m, -0.2 - 0.1 * aside_m),
        (-along_m, np.full(200, -1.2)),
    ]
    tracks = [
        Track(str(number), (along_m + 4.0), np.stack(way, axis=1))
        for number, way in enumerate(ways)
    ]
    found = head_on(recorded_moments(tracks, Corridor(0, (0.0, 0.0), 4.0)))
    np.testing.assert_allclose(sorted(found[:, 1]), [0.1, 0.3], atol=1e-9)
    np.testing.assert_allclose(found[:, 0], 0.6, atol=1e-9)
    assert meetings_row("both", found)["meetings"] == 1
    assert len(head_on(recorded_moments(tracks, Corridor(0, (0.0, 0.0), 4.0)), meets=1)) == 1


def test_people_pass_a_robot_and_come_near_to_each_other_as_recorded_people_do():
    """Passing at 0.62 m in the median; 5 % of nearest neighbours below 0.39 m (docs/crowd.md)."""
    walk = {"model": "collision_prediction", "density_pm2": 1.0, "seed": 1, "duration_s": 30.0}
    passing_m = head_on(simulated_moments(**walk, robot=True), ROBOT)[:, 0]
    assert np.median(passing_m) == pytest.approx(0.62, abs=0.06)
    nearest_m = []
    for _, x_m, y_m, _ in islice(simulated_moments(**walk, robot=False), 0, None, 20):
        along_m = np.abs(x_m - x_m[:, None])
        away_m = np.hypot(np.minimum(along_m, 20.0 - along_m), y_m - y_m[:, None])
        nearest_m.append((away_m + 9.0 * np.eye(len(away_m))).min(axis=1))
    assert np.quantile(nearest_m, 0.05) == pytest.approx(0.39, abs=0.06)


def test_who_was_out_of_sight_meets_anew():
    """Two come head-on, are parted by the cut of the ring, and pass each other 1 m apart."""
    ids, along_mps = np.arange(2), np.array([1.0, -1.0])
    ways = [(2.8, 0.1), (8.0, 0.1), (2.8, 1.0), (-0.1, 1.0)]
    moments = [(ids, np.array([0.0, gap]), np.array([0.0, y]), along_mps) for gap, y in ways]
    assert not len(head_on(moments))
    assert len(head_on([moments[0], moments[-1]])) == 2


def turned_by(degrees):
    cos, sin = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[cos, sin], [-sin, cos]])


def crossing(width_m, turn, rng):
    """People through a corridor of 9 m, who all end farther to the right than they begin."""
    times_s = np.arange(0.0, 9.0, 0.1)
    tracks = []
    for number in range(80):
        begin_m = rng.uniform(0.2, width_m - 0.2)
        end_m = rng.uniform(begin_m, width_m - 0.2)
        across_m = np.interp(times_s, [0.0, 8.9], [begin_m, end_m])
        places_m = np.stack([times_s + rng.uniform(0.0, 0.3), -across_m], axis=1) @ turn
        tracks.append(Track(str(number), times_s + number, places_m))
    return tracks


@pytest.mark.parametrize(
    ("width_m", "degrees"), [(3.0, 90.0), (3.6, 90.0), (4.0, 0.0), (3.0, 30.0)]
)
def test_people_who_cross_a_corridor_do_not_turn_it(width_m, degrees):
    turn = turned_by(degrees)
    tracks = crossing(width_m, turn, np.random.default_rng(7))
    corners = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, -width_m], [0.0, -width_m]])
    for area_m in (None, shapely.Polygon(corners @ turn)):
        found = corridor_people(tracks, area_m)
        assert found.axis == round(degrees / 90.0)
        turned = [each for each in found.remarks if "turned" in each]
        assert len(turned) == (degrees == 30.0)
        across = np.concatenate([t.position_m[:, 1 - found.axis] for t in found.tracks])
        assert np.ptp(across) == pytest.approx(width_m - 0.4, abs=0.35)
        if area_m is not None:
            low, high = found.sides_m
            assert high - low == pytest.approx(width_m, abs=0.01)
            assert low < across.min() < across.max() < high
