"""The crowd against measured ones: Weidmann, RiMEA, lanes, and a real corridor."""

from pathlib import Path

import numpy as np
import pytest

from serd_core.errors import SerdError
from sim.crowd import Crowd
from sim.lane_order import lane_order, shuffled_lane_order
from sim.polygon import contains, edges_of
from sim.ring_corridor import ring_corridor_crowd, weidmann_speed_mps
from sim.routes import Routes
from sim.social_force import model_named, model_names

REAL_CORRIDOR = (
    Path(__file__).parents[3] / "shared" / "data" / "pedestrians" / "bi_corr_400_b_03.txt"
)


def mean_speed_mps(crowd, settle_steps=400, steps=600):
    speeds = []
    for step in range(settle_steps + steps):
        crowd.step(0.05)
        if step >= settle_steps:
            speeds.append(np.hypot(crowd.velocity_x_mps, crowd.velocity_y_mps).mean())
    return float(np.mean(speeds))


@pytest.mark.parametrize("density_pm2", [0.5, 1.0, 1.5, 2.0])
def test_walking_speed_falls_with_density_as_weidmann_measured(density_pm2):
    crowd = ring_corridor_crowd(
        width_m=4.0, length_m=20.0, density_pm2=density_pm2, rng=np.random.default_rng(1)
    )
    expected = float(weidmann_speed_mps(density_pm2))
    assert mean_speed_mps(crowd) == pytest.approx(expected, abs=0.1)


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
                baselines.append(shuffled_lane_order(crowd.y_m, crowd.velocity_x_mps, rng, 0.4, 20))
    assert np.mean(orders) > 2.0 * np.mean(baselines)


def test_perfect_lanes_have_order_one():
    assert lane_order(np.array([1.0, 1.1, 3.0, 3.1]), np.array([1.0, 1.2, -1.0, -0.9])) == 1.0


@pytest.mark.parametrize(
    ("model", "n_arrive"), [("circular_anisotropic", 20), ("helbing_molnar_1995", 6)]
)
def test_twenty_people_go_round_a_corner_and_nobody_through_the_wall(model, n_arrive):
    """RiMEA test 6: a corner between corridors 2 m wide.

    The model of 1995 with its published parameters jams at the corner: few arrive in 30 s.
    """
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


@pytest.mark.slow
@pytest.mark.parametrize("model", model_names())
def test_nobody_passes_a_wall_in_a_hundred_thousand_steps_at_3_people_per_square_metre(model):
    crowd = ring_corridor_crowd(
        width_m=2.0,
        length_m=4.0,
        density_pm2=3.0,
        share_backwards=0.5,
        model_name=model,
        rng=np.random.default_rng(4),
    )
    for _ in range(100_000):
        crowd.step(0.05)
        if not (crowd.y_m.min() > 0.0 and crowd.y_m.max() < 2.0):
            pytest.fail(f"somebody is at y = {crowd.y_m.min()} or {crowd.y_m.max()} m")


@pytest.fixture(scope="module")
def real_corridor():
    """(density, speed) of each frame and the nearest opposing pair, in 4 m of a real corridor."""
    if not REAL_CORRIDOR.exists():
        pytest.skip(f"no recording of a real corridor at {REAL_CORRIDOR}")
    rows = np.loadtxt(REAL_CORRIDOR)
    person, frame, place = rows[:, 0], rows[:, 1].astype(int), rows[:, 2:4] / 100.0
    velocity = np.full_like(place, np.nan)
    for one in np.unique(person):
        mine = np.flatnonzero(person == one)
        velocity[mine[5:-5]] = (place[mine[10:]] - place[mine[:-10]]) / (10 / 25)
    area = np.abs(place[:, 0]) < 2.0
    densities, speeds, gaps = [], [], []
    for moment in np.unique(frame)[::5]:
        here = (frame == moment) & area & np.isfinite(velocity[:, 0])
        if here.sum() < 2:
            continue
        densities.append(here.sum() / 16.0)
        speeds.append(np.hypot(*velocity[here].T).mean())
        gaps.append(nearest_opposing_m(place[here], velocity[here, 0]))
    return np.array(densities), np.array(speeds), np.array(gaps)


def nearest_opposing_m(place, along_mps):
    away = np.linalg.norm(place[:, None] - place[None, :], axis=2)
    opposing = along_mps[:, None] * along_mps[None, :] < 0
    return float(away[opposing].min()) if opposing.any() else np.nan


@pytest.mark.parametrize("density_pm2", [0.75, 1.0])
def test_two_way_traffic_is_as_fast_and_passes_as_close_as_in_a_real_corridor(
    density_pm2, real_corridor
):
    """BaSiGo corridor of 4 m: speed within 0.15 m/s, median distance of passing within 0.35 m.

    Simulated people keep about 0.25 m more distance from those who come towards them.
    """
    densities, speeds, gaps = real_corridor
    near = np.abs(densities - density_pm2) < 0.13
    crowd = ring_corridor_crowd(
        width_m=4.0,
        length_m=20.0,
        density_pm2=density_pm2,
        share_backwards=0.5,
        keep_right=True,
        rng=np.random.default_rng(1),
    )
    assert mean_speed_mps(crowd) == pytest.approx(speeds[near].mean(), abs=0.15)
    simulated = []
    for _ in range(100):
        crowd.step(0.05)
        place = np.stack([crowd.x_m, crowd.y_m], axis=1)
        window = crowd.x_m < 4.0
        simulated.append(nearest_opposing_m(place[window], crowd.velocity_x_mps[window]))
    assert np.nanmedian(simulated) == pytest.approx(np.nanmedian(gaps[near]), abs=0.35)


def test_a_density_that_gives_nobody_is_refused_with_the_fix():
    with pytest.raises(SerdError, match="raise it or lengthen the ring"):
        ring_corridor_crowd(
            width_m=2.0, length_m=2.0, density_pm2=0.01, rng=np.random.default_rng(1)
        )
