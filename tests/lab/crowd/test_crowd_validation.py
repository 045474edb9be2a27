"""The crowd against measured ones: Weidmann, RiMEA, lanes, and a real corridor."""

from pathlib import Path

import numpy as np
import pytest

from lab.crowd.corridor_measures import (
    Corridor,
    corridor_of,
    measure_recording,
    measure_simulation,
)
from lab.crowd.ring_corridor import ring_corridor_crowd, weidmann_speed_mps
from serd_files.trajectories.read import Track, read_trajectories
from serd_sim.crowd.crowd import Crowd, start_crowd
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import model_named, model_names
from serd_sim.scenario.polygon import contains, edges_of
from serd_sim.scenario.scenario import load_scenario

REAL_CORRIDOR = (
    Path(__file__).parents[4] / "shared" / "data" / "pedestrians" / "bi_corr_400_b_03.txt"
)


def mean_speed_mps(crowd, settle_steps=400, steps=600):
    speeds = []
    for step in range(settle_steps + steps):
        crowd.step(0.05)
        if step >= settle_steps:
            speeds.append(np.hypot(crowd.velocity_x_mps, crowd.velocity_y_mps).mean())
    return float(np.mean(speeds))


@pytest.mark.parametrize(
    ("density_pm2", "bias_mps"), [(0.5, -0.08), (1.0, 0.01), (1.5, 0.07), (2.0, 0.03)]
)
def test_walking_speed_falls_with_density_as_weidmann_measured(density_pm2, bias_mps):
    """Within 0.1 m/s for every seed, with a bias that is the model's own: it varies by 0.01 m/s."""
    excess_mps = [
        mean_speed_mps(
            ring_corridor_crowd(
                width_m=4.0, length_m=20.0, density_pm2=density_pm2, rng=np.random.default_rng(seed)
            )
        )
        - float(weidmann_speed_mps(density_pm2))
        for seed in (1, 2, 3)
    ]
    assert np.abs(excess_mps).max() < 0.1
    assert np.mean(excess_mps) == pytest.approx(bias_mps, abs=0.02)


def lane_order(across_m, along_mps, strip_m=0.4):
    """Order of two-way traffic in lanes (Rex & Löwen, Physical Review E 75, 2007).

    phi_i = ((n_same - n_opposite) / (n_same + n_opposite))^2 over the people in the same strip
    along the way; the order is the mean of phi_i, 1 for perfect lanes.
    """
    same_strip = np.abs(across_m[:, None] - across_m[None, :]) < strip_m
    agreement = np.sign(along_mps)[:, None] * np.sign(along_mps)[None, :]
    share = np.sum(same_strip * agreement, axis=1) / np.sum(same_strip, axis=1)
    return float(np.mean(share**2))


def shuffled_lane_order(across_m, along_mps, rng, n_shuffles=20):
    """Mean order of the same people with shuffled directions: the baseline."""
    orders = [lane_order(across_m, rng.permutation(along_mps)) for _ in range(n_shuffles)]
    return float(np.mean(orders))


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
                baselines.append(shuffled_lane_order(crowd.y_m, crowd.velocity_x_mps, rng))
    assert np.mean(orders) > 2.0 * np.mean(baselines)


def test_perfect_lanes_have_order_one():
    assert lane_order(np.array([1.0, 1.1, 3.0, 3.1]), np.array([1.0, 1.2, -1.0, -0.9])) == 1.0


@pytest.mark.parametrize("model", model_names())
def test_people_in_the_hallway_never_jam(model):
    """For 100 s the 24 people of the scenario keep walking, round corners and past each other."""
    hallway = load_scenario("hallway")
    people = hallway.pedestrians.model_copy(update={"model": model})
    crowd = start_crowd(
        people, hallway.directed_loops, hallway.wall_segments_m, np.random.default_rng(1)
    )
    speeds = []
    for step in range(2000):
        crowd.step(0.05)
        if step >= 1000:
            speeds.append(np.hypot(crowd.velocity_x_mps, crowd.velocity_y_mps))
    assert np.mean(speeds) > 0.7
    assert np.mean(speeds, axis=0).min() > 0.1


@pytest.mark.parametrize(
    ("model", "n_arrive"), [("circular_anisotropic", 20), ("helbing_molnar_1995", 15)]
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


@pytest.mark.slow
@pytest.mark.parametrize("model", model_names())
def test_nobody_passes_a_wall_in_twenty_thousand_steps_at_3_people_per_square_metre(model):
    crowd = ring_corridor_crowd(
        width_m=2.0,
        length_m=4.0,
        density_pm2=3.0,
        share_backwards=0.5,
        model_name=model,
        rng=np.random.default_rng(4),
    )
    for _ in range(20_000):
        crowd.step(0.05)
        if not (crowd.y_m.min() > 0.0 and crowd.y_m.max() < 2.0):
            pytest.fail(f"a person is at y = {crowd.y_m.min()} or {crowd.y_m.max()} m")


@pytest.fixture(scope="module")
def recorded():
    if not REAL_CORRIDOR.exists():
        pytest.skip(f"no recording of a real corridor at {REAL_CORRIDOR}")
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    corridor = Corridor(axis=0, middle_m=(0.0, 2.0), width_m=4.0)
    return measure_recording(read_trajectories(REAL_CORRIDOR).tracks, corridor)


@pytest.mark.parametrize("density_pm2", [0.75, 1.0, 1.25])
def test_people_who_predict_collisions_walk_as_fast_as_recorded_ones(density_pm2, recorded):
    """Within one standard deviation of the recorded speeds, also where the other models jam."""
    real = recorded.near_density(density_pm2)
    simulated = measure_simulation(density_pm2, model_name="collision_prediction")
    assert len(real.person_speed_mps) > 100
    assert abs(simulated.speed_mps.mean() - real.speed_mps.mean()) < real.person_speed_mps.std()


@pytest.mark.parametrize("density_pm2", [0.75, 1.0, 1.25])
def test_two_way_traffic_is_as_fast_and_passes_as_close_as_in_a_real_corridor(
    density_pm2, recorded
):
    """BaSiGo corridor of 4 m: speed within 0.15 m/s, median passing distance within 0.25 m."""
    real = recorded.near_density(density_pm2)
    simulated = measure_simulation(density_pm2)
    assert simulated.speed_mps.mean() == pytest.approx(real.speed_mps.mean(), abs=0.15)
    passing = np.nanmedian(simulated.passing_distance_m)
    assert passing == pytest.approx(np.nanmedian(real.passing_distance_m), abs=0.25)


def test_measures_of_a_recording_made_by_hand(tmp_path):
    """Two people pass each other at 1 m/s, 0.8 m apart, in the middle of the corridor.

    They share it up to 0.1 m beyond the farthest place, 3.08 m to either side.
    """
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    frames = np.arange(150)
    along = (frames - 75) / 25.0
    rows = [[1, f, 100 * x, 40, 176] for f, x in zip(frames, along, strict=True)]
    rows += [[2, f, -100 * x, -40, 176] for f, x in zip(frames, along, strict=True)]
    path = tmp_path / "two.txt"
    np.savetxt(path, rows, header="framerate: 25\nid frame x/cm y/cm z/cm")
    tracks = read_trajectories(path).tracks
    assert corridor_of(tracks).flow == "two ways"
    measures = measure_recording(tracks, corridor_of(tracks, width_m=4.0))
    assert measures.density_pm2 == pytest.approx(2 / (4.0 * 2 * 3.1), rel=1e-6)
    assert measures.speed_mps == pytest.approx(1.0)
    assert measures.person_speed_mps == pytest.approx(1.0)
    assert measures.passing_distance_m.min() == pytest.approx(0.8)
    assert measures.nearest_m.min() == pytest.approx(0.8)


def test_a_recording_may_begin_half_a_frame_later_and_hold_a_person_twice():
    """Half frames were rounded to even ones, so that people were twice in these."""
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    frame = np.arange(150.0)
    along_m = (frame - 75.0) / 25.0

    def measured(frame):
        tracks = [
            Track(f"{side} {sign}", frame / 25.0, np.stack([sign * along_m, y_m], axis=1))
            for sign, side in ((1.0, 0.4), (-1.0, -0.4), (1.0, 0.4))
            for y_m in [np.full_like(along_m, side)]
        ]
        return measure_recording(tracks, Corridor(0, (0.0, 0.0), 4.0))

    np.testing.assert_allclose(measured(frame + 0.5).density_pm2, measured(frame).density_pm2)


@pytest.mark.parametrize("apart_m", [0.8, 1.0])
def test_people_on_a_moving_lattice_have_its_density_its_speed_and_its_distance(apart_m):
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    time_s = np.arange(0.0, 2.0, 0.1)
    columns, rows = np.arange(-10, 11), np.arange(-1.5, 2.0)
    tracks = [
        Track(f"{column} {row}", time_s, np.stack([apart_m * column + 0.9 * time_s, y_m], axis=1))
        for column in columns
        for row in rows
        for y_m in [np.full_like(time_s, apart_m * row)]
    ]
    measures = measure_recording(tracks, Corridor(0, (0.9, 0.0), 4.0 * apart_m))
    assert measures.density_pm2 == pytest.approx(1.0 / apart_m**2)
    assert measures.speed_mps == pytest.approx(0.9)
    assert measures.nearest_m == pytest.approx(apart_m)
    assert np.isnan(measures.passing_distance_m).all()
