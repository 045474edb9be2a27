"""Laws of the social force models."""

import dataclasses
import math

import numpy as np
import pytest

from serd_sim.crowd import neighbours
from serd_sim.crowd.crowd import Crowd, start_crowd
from serd_sim.crowd.robots import RobotBody, headings_around
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import WallGeometry, model_named, model_names
from serd_sim.scenario.polygon import contains
from serd_sim.scenario.scenario import load_scenario

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


@pytest.mark.parametrize("robot_radius_m", [0.25, 0.4])
def test_people_keep_their_whole_body_off_a_robot(robot_radius_m):
    """A robot one metre ahead at the same velocity comes no nearer: both repulsions as they are."""
    model = model_named("collision_prediction")
    crowd = crowd_at("collision_prediction", [[0.0, 0.0]], [[50.0, 0.0]])
    crowd.step(1e-6, RobotBody(1.0, 0.0, 1.34, 0.0, robot_radius_m))
    touch_m = model.body_radius_m + robot_radius_m
    expected = model.strength_mps2 * np.exp((2.0 * model.radius_m - 1.0) / model.decay_m)
    expected += model.core_strength_mps2 * np.exp((touch_m - 1.0) / model.core_decay_m)
    assert (1.34 - crowd.velocity_x_mps[0]) / 1e-6 == pytest.approx(expected, rel=1e-4)


def test_people_are_pushed_away_from_where_the_other_one_will_be():
    """Who comes 0.2 m beside the own line is there within the foresight: the push is sideways."""
    model = model_named("collision_prediction")
    crowd = crowd_at("collision_prediction", [[0.0, 0.0], [1.5, 0.2]], [[50.0, 0.0], [-50.0, 0.2]])
    crowd.step(1e-6)
    assert (crowd.velocity_x_mps[0] - 1.34) / 1e-6 == pytest.approx(0.0, abs=0.01)
    expected = -model.strength_mps2 * np.exp((2.0 * model.radius_m - 0.2) / model.decay_m)
    assert crowd.velocity_y_mps[0] / 1e-6 == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("model", "period_m"),
    [("collision_prediction", 0.0), ("collision_prediction", 12.0), ("helbing_molnar_1995", 0.0)],
)
def test_many_people_walk_as_if_all_were_paired(monkeypatch, model, period_m):
    """What is left out beyond the reach is below a tenth of a millimetre in a second."""
    rng = np.random.default_rng(3)
    place, goal = rng.uniform(0, 12, (80, 2)), rng.uniform(20, 40, (80, 2))
    walks = []
    for few in (60, 1000):
        monkeypatch.setattr(neighbours, "_FEW", few)
        crowd = crowd_at(model, place, goal, period_m=period_m)
        crowd.x_m[0] = period_m
        walks.append(walk(crowd, 20, RobotBody(6.0, 6.0, 0.5, 0.0, 0.25)))
    np.testing.assert_allclose(*walks, atol=1e-4)


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


CLEARANCE_M, BODY_M, ROBOT_M = 0.2, 0.25, 0.25
CIRCLE_M = CLEARANCE_M + BODY_M + ROBOT_M
EAST = 0.0


def robot_at(x_m, y_m, velocity_x_mps=0.0):
    return RobotBody(x_m, y_m, velocity_x_mps, 0.0, ROBOT_M)


def heading_of_person_at_origin(robot, wanted_rad=EAST, *, walls_m=FAR_WALL, speed_mps=1.3):
    """Direction (rad) in which a person who wants to go in another one goes past the robot."""
    to_m = np.array([robot.x_m]), np.array([robot.y_m]), np.hypot([robot.x_m], [robot.y_m])
    wanted = np.array([math.cos(wanted_rad)]), np.array([math.sin(wanted_rad)])
    walls = WallGeometry(walls_m)
    x, y = headings_around(robot, to_m, wanted, np.array([speed_mps]), walls, BODY_M, CLEARANCE_M)
    assert math.hypot(x[0], y[0]) == pytest.approx(1.0)
    return math.atan2(y[0], x[0])


def wall_at_y(y_m):
    return np.array([[[-50.0, y_m], [50.0, y_m]]])


@pytest.mark.parametrize(("y_m", "side"), [(0.3, -1.0), (-0.3, 1.0)])
def test_the_tangent_leads_past_the_robot_on_the_nearer_side(y_m, side):
    found = heading_of_person_at_origin(robot_at(2.0, y_m))
    away = math.hypot(2.0, y_m)
    assert found == pytest.approx(math.atan2(y_m, 2.0) + side * math.asin(CIRCLE_M / away))


@pytest.mark.parametrize(
    "place", [(-1.0, 0.0), (1.0, CIRCLE_M + 0.01), (CIRCLE_M + 2.01, 0.0), (1.0, 0.0, 1.4)]
)
def test_a_robot_behind_beside_the_way_far_away_or_faster_changes_no_heading(place):
    assert heading_of_person_at_origin(robot_at(*place)) == pytest.approx(EAST)
    slower = robot_at(1.5, 0.0, velocity_x_mps=0.5)
    assert heading_of_person_at_origin(slower) > 0.3, "people overtake it"


def test_people_pass_on_the_other_side_where_a_wall_leaves_no_room():
    robot = robot_at(2.0, 0.3)
    lowest_m = 0.3 - CIRCLE_M / 2.0 * math.hypot(2.0, 0.3)  # of the place beside the robot
    assert heading_of_person_at_origin(robot, walls_m=wall_at_y(lowest_m - 1.1 * BODY_M)) < 0.0
    for wall_m in (lowest_m, lowest_m + 1.1 * BODY_M):
        assert heading_of_person_at_origin(robot, walls_m=wall_at_y(wall_m)) > 0.0


@pytest.mark.parametrize(("clearance_m", "passes"), [(0.1, True), (None, False)])
def test_who_meets_a_robot_in_line_walks_around_it_and_is_not_pushed_back(clearance_m, passes):
    """It comes at 0.3 m/s; on the left a wall leaves no room. Repulsion alone has no side here."""
    assert model_named("collision_prediction").evasion_clearance_m == 0.1
    walls_m = wall_at_y(0.6) if passes else FAR_WALL
    crowd = crowd_at("collision_prediction", [[0.0, 0.0]], [[50.0, 0.0]], walls_m=walls_m)
    crowd._model = dataclasses.replace(crowd._model, evasion_clearance_m=clearance_m)
    for x_m in 4.0 - 0.3 * 0.05 * np.arange(200):
        place = walk(crowd, 1, robot_at(x_m, 0.0, velocity_x_mps=-0.3))[0]
    assert bool(place[0] > x_m) is passes
    assert not passes or place[1] < 0.1


def test_in_a_ring_corridor_people_see_the_robot_beyond_the_seam():
    crowd = crowd_at("collision_prediction", [[9.5, 0.0]], [[50.0, 0.0]], period_m=10.0)
    crowd.step(0.05, robot_at(1.0, 0.1))
    assert crowd.velocity_y_mps[0] < -0.05


HALLWAY = load_scenario("hallway")


def hallway_crowd(count, seed, model="collision_prediction"):
    settings = HALLWAY.with_pedestrian_count(count).pedestrians
    settings = settings.model_copy(update={"model": model})
    return start_crowd(
        settings, settings.loops, HALLWAY.wall_segments_m, np.random.default_rng(seed)
    )


@pytest.mark.parametrize("model", model_names())
def test_nobody_leaves_a_crowded_hallway(model):
    crowd = hallway_crowd(150, 5, model)
    for _ in range(200):
        crowd.step(0.05)
    assert contains(HALLWAY.walkable_area_m, places_of(crowd)).all()


def places_of(crowd):
    return np.stack([crowd.x_m, crowd.y_m], axis=1)


def test_a_push_is_at_most_a_tenth_of_a_metre_and_never_carries_through_a_wall():
    crowd = hallway_crowd(24, 6)
    crowd.x_m[:3], crowd.y_m[:3] = (3.05, 3.46, 5.84), (10.0, 8.0, 12.0)
    for x_m, y_m in ((3.0, 10.0), (3.0, 8.0), (5.8, 12.0)):
        crowd.push_out_of(RobotBody(x_m, y_m, 0.0, 0.0, 0.25))
    assert crowd.x_m[:3] == pytest.approx([3.15, 3.5, 5.85])  # 0.15 m from the wall at 6 m
    assert crowd.y_m[:3] == pytest.approx([10.0, 8.0, 12.0])


def test_wanted_speeds_lie_within_two_deviations_of_the_mean():
    speed = hallway_crowd(400, 8).desired_speed_mps
    settings = HALLWAY.pedestrians
    limit = 2 * settings.desired_speed_deviation_mps + 1e-12
    assert np.abs(speed - settings.desired_speed_mean_mps).max() <= limit
    assert speed.mean() == pytest.approx(settings.desired_speed_mean_mps, abs=0.04)


def test_people_who_stand_are_pushed_aside_and_return():
    group = load_scenario("social_v1/group")
    places, rng = np.array(group.pedestrians.standing_m), np.random.default_rng(1)
    crowd = start_crowd(group.pedestrians, group.pedestrians.loops, group.wall_segments_m, rng)

    def away_m(n_steps):
        for _ in range(n_steps):
            crowd.step(0.05)
        return np.hypot(*(places_of(crowd)[-len(places) :] - places).T).max()

    assert away_m(200) < 0.3
    crowd.move(len(crowd) - 1, (places[-1][0] + 0.8, places[-1][1]), (0.0, 0.0))
    assert away_m(0) > 0.7
    assert away_m(200) < 0.3


SQUARE = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])


@pytest.mark.parametrize(
    ("place", "ahead"),
    [((4.0, 1.0), (5.0, -1.0)), ((17.0, 1.0), (3.0, -1.0)), ((19.7, 0), (0.3, 5))],
)
def test_people_head_for_a_point_five_metres_ahead_on_the_line_or_the_corner_before(place, ahead):
    """At the end of a leg the next one is taken."""
    routes = Routes([SQUARE])
    routes.place(np.array([0.01]))
    heading = np.concatenate(routes.headings(*np.array(place, float)[:, None]))
    assert heading == pytest.approx(np.array(ahead) / np.hypot(*ahead))


def test_people_are_placed_along_the_whole_loop_by_its_length():
    routes = Routes([SQUARE] * 4)
    x_m, y_m = routes.place(np.array([0.0, 0.125, 0.5, 0.9]))
    assert x_m == pytest.approx([0.0, 10.0, 20.0, 0.0])
    assert y_m == pytest.approx([0.0, 0.0, 20.0, 8.0])
