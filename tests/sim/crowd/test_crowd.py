"""The crowd as a whole: walls hold, loops are walked, speeds fall with density."""

import numpy as np
import pytest

from serd_sim.crowd.crowd import people_per_loop, start_crowd
from serd_sim.crowd.robots import RobotBody
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import model_names
from serd_sim.scenario.polygon import contains, distance_to_segments_m
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")


def hallway_crowd(count, seed, model="circular_anisotropic"):
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


def test_a_robot_that_squeezes_people_against_a_wall_pushes_nobody_through_it():
    crowd = hallway_crowd(24, 6)
    crowd.x_m[0], crowd.y_m[0] = 5.9, 10.0
    for x_m in np.linspace(5.0, 5.75, 30):
        robot = RobotBody(x_m, 10.0, 0.3, 0.0, 0.25)
        crowd.step(0.05, robot)
        crowd.push_out_of(robot)
    place = places_of(crowd)
    assert contains(HALLWAY.walkable_area_m, place).all()
    assert distance_to_segments_m(place, HALLWAY.wall_segments_m).min() > 0.1


def test_a_push_is_at_most_a_tenth_of_a_metre_and_never_carries_through_a_wall():
    crowd = hallway_crowd(24, 6)
    crowd.x_m[:3], crowd.y_m[:3] = (3.05, 3.46, 5.84), (10.0, 8.0, 12.0)
    for x_m, y_m in ((3.0, 10.0), (3.0, 8.0), (5.8, 12.0)):
        crowd.push_out_of(RobotBody(x_m, y_m, 0.0, 0.0, 0.25))
    assert crowd.x_m[:3] == pytest.approx([3.15, 3.5, 5.85])  # 0.15 m from the wall at 6 m
    assert crowd.y_m[:3] == pytest.approx([10.0, 8.0, 12.0])


def test_people_walk_on_the_right_of_the_hallway():
    crowd, on_their_side = hallway_crowd(24, 7), []
    for _ in range(300):
        crowd.step(0.05)
        middle = (crowd.y_m > 4) & (crowd.y_m < 14) & (np.abs(crowd.velocity_y_mps) > 0.5)
        on_their_side += ((crowd.velocity_y_mps > 0) == (crowd.x_m > 3))[middle].tolist()
    assert len(on_their_side) > 1000
    assert np.mean(on_their_side) > 0.97


def test_people_are_shared_out_to_loops_by_largest_remainder():
    loops = HALLWAY.pedestrians.loops
    assert people_per_loop(loops, 24) == [12, 6, 6]
    assert people_per_loop(loops, 0) == [0, 0, 0]
    assert sum(people_per_loop(loops, 17)) == 17


def test_wanted_speeds_lie_within_two_deviations_of_the_mean():
    speed = hallway_crowd(400, 8).desired_speed_mps
    settings = HALLWAY.pedestrians
    limit = 2 * settings.desired_speed_deviation_mps + 1e-12
    assert np.abs(speed - settings.desired_speed_mean_mps).max() <= limit
    assert speed.mean() == pytest.approx(settings.desired_speed_mean_mps, abs=0.04)


def test_people_who_stand_are_pushed_aside_and_return():
    group = load_scenario("social_v1/group")
    places, rng = np.array(group.pedestrians.standing_m), np.random.default_rng(1)
    crowd = start_crowd(group.pedestrians, group.directed_loops, group.wall_segments_m, rng)

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
