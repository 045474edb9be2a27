"""Laws of the social force models."""

import numpy as np
import pytest

from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.robots import RobotBody
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import model_named, model_names

FAR_WALL = np.array([[[-500.0, -500.0], [500.0, -500.0]]])


def crowd_at(
    model_name, position_m, goal_m, *, walls_m=FAR_WALL, speed_mps=1.34, noise=0.0, period_m=0.0
):
    """People at (N, 2) places, each with a separate loop from there to its goal and back."""
    position, goal = np.asarray(position_m, float), np.asarray(goal_m, float)
    across = np.stack([position[:, 1] - goal[:, 1], goal[:, 0] - position[:, 0]], axis=1)
    routes = Routes(list(np.stack([position, goal, goal + across], axis=1)))
    routes.place(np.zeros(len(position)))
    return Crowd(
        model=model_named(model_name),
        routes=routes,
        x_m=position[:, 0].copy(),
        y_m=position[:, 1].copy(),
        desired_speed_mps=np.full(len(position), speed_mps),
        walls_m=walls_m,
        fluctuation_mps2=noise,
        rng=np.random.default_rng(1),
        period_m=period_m,
    )


def walk(crowd, n_steps, *robots):
    for _ in range(n_steps):
        crowd.step(0.05, *robots)
    return np.stack([crowd.x_m, crowd.y_m], axis=1)


@pytest.mark.parametrize("model", model_names())
def test_two_at_one_spot_part_without_nan(model):
    place = walk(crowd_at(model, [[0, 0], [0, 0]], [[50, 0], [50, 0]]), 60)
    assert np.linalg.norm(place[0] - place[1]) > 0.3
    robot = RobotBody(0.0, 0.0, 0.0, 0.0, 0.25)
    assert np.linalg.norm(walk(crowd_at(model, [[0, 0]], [[50, 0]]), 40, robot)[0]) > 0.4


@pytest.mark.parametrize("model", model_names())
def test_a_rotated_world_gives_the_rotated_trajectories(model):
    rng = np.random.default_rng(7)
    position, goal = rng.uniform(0, 6, (12, 2)), rng.uniform(20, 40, (12, 2))
    angle = 0.7
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    wall = np.array([[[-5.0, -1.0], [60.0, -1.0]]])
    plain = walk(crowd_at(model, position, goal, walls_m=wall), 80)
    turned = walk(crowd_at(model, position @ turn, goal @ turn, walls_m=wall @ turn), 80)
    np.testing.assert_allclose(turned, plain @ turn, atol=1e-8)


@pytest.mark.parametrize("model", model_names())
def test_people_walk_alone_at_the_wanted_speed_and_among_others_at_most_1_3_times_as_fast(model):
    alone = walk(crowd_at(model, [[0, 0]], [[100, 0]], speed_mps=1.33), round(40 / 1.33 / 0.05))
    assert alone[0, 0] == pytest.approx(40.0, abs=0.2)
    rng = np.random.default_rng(2)
    crowd = crowd_at(model, rng.uniform(0, 2, (20, 2)), rng.uniform(20, 40, (20, 2)), noise=1.0)
    for _ in range(100):
        crowd.step(0.05)
        speed = np.hypot(crowd.velocity_x_mps, crowd.velocity_y_mps)
        assert speed.max() <= 1.3 * 1.34 + 1e-9


def test_people_push_less_from_behind_than_from_the_front():
    """A person straight behind pushes lambda times as much as one straight ahead."""
    crowd = crowd_at("circular_anisotropic", [[0.0, 0.0], [1.0, 0.0]], [[50.0, 0.0], [51.0, 0.0]])
    crowd.step(1e-6)
    slowed, sped = (crowd.velocity_x_mps - 1.34) / 1e-6
    assert slowed == pytest.approx(-4.0 * np.exp((0.5 - 1.0) / 0.25), rel=1e-4)
    assert sped == pytest.approx(-0.45 * slowed, rel=1e-4)


@pytest.mark.parametrize("robot_radius_m", [0.25, 0.4])
def test_people_keep_their_whole_body_and_a_clearance_off_a_robot(robot_radius_m):
    """A robot one metre ahead at the same velocity comes no nearer: both repulsions as they are."""
    model = model_named("collision_prediction")
    crowd = crowd_at("collision_prediction", [[0.0, 0.0]], [[50.0, 0.0]])
    crowd.step(1e-6, RobotBody(1.0, 0.0, 1.34, 0.0, robot_radius_m))
    touch_m = model.body_radius_m + robot_radius_m
    expected = model.strength_mps2 * np.exp((touch_m + 0.1 - 1.0) / model.decay_m)
    expected += model.core_strength_mps2 * np.exp((touch_m - 1.0) / model.core_decay_m)
    assert (1.34 - crowd.velocity_x_mps[0]) / 1e-6 == pytest.approx(expected, rel=1e-4)


def test_people_are_pushed_away_from_where_the_other_one_will_be():
    """Who comes 0.2 m beside the own line is there within the foresight: the push is sideways."""
    crowd = crowd_at("collision_prediction", [[0.0, 0.0], [1.5, 0.2]], [[50.0, 0.0], [-50.0, 0.2]])
    crowd.step(1e-6)
    assert (crowd.velocity_x_mps[0] - 1.34) / 1e-6 == pytest.approx(0.0, abs=0.01)
    assert crowd.velocity_y_mps[0] / 1e-6 < -5.0


def test_the_published_model_pushes_along_the_gradient_of_its_elliptic_potential():
    """f = -grad V0 exp(-b / sigma) by finite differences of b (Helbing & Molnar 1995, Eq. 3-4)."""
    model = model_named("helbing_molnar_1995")
    crowd = crowd_at("helbing_molnar_1995", [[0.3, -0.9], [1.0, 0.2]], [[0.3, -50], [50, 0.2]])
    crowd.velocity_x_mps[:], crowd.velocity_y_mps[:] = [0.0, 0.8], [-1.34, 0.0]

    def potential(away):
        stride = 0.8 * model.stride_s * np.array([1.0, 0.0])
        both = np.linalg.norm(away) + np.linalg.norm(away - stride)
        axis = 0.5 * np.sqrt(both**2 - stride[0] ** 2)
        return model.potential_m2ps2 * np.exp(-axis / model.decay_m)

    away, eps = np.array([-0.7, -1.1]), 1e-6
    steps = eps * np.eye(2)
    expected = [-(potential(away + e) - potential(away - e)) / (2 * eps) for e in steps]
    crowd.step(1e-7)
    force = np.array([crowd.velocity_x_mps[0], crowd.velocity_y_mps[0] + 1.34]) / 1e-7
    np.testing.assert_allclose(force, model.rear_weight * np.array(expected), rtol=2e-3, atol=1e-4)
