"""Several robots in one world: the people are the same, each is in the other's way and scan."""

import math
from functools import partial

import numpy as np
import pytest

from serd_core.errors import SerdError
from sim.crowd.robots import RobotBody
from sim.planning.catalogue import make_planner
from sim.robot.robot import standing_at
from sim.scenario.scenario import load_scenario
from sim.world.command import STOP, Command
from sim.world.shared_world import SharedWorld
from sim.world.waypoint import Waypoint
from sim.world.world import HallwayWorld

HALLWAY = load_scenario("hallway").with_values("robot", drive="kinematic")
EMPTY = HALLWAY.with_pedestrian_count(0)
RADIUS_M = HALLWAY.robot.radius_m


def part(scenario, name, **changes):
    return scenario.model_copy(update={name: getattr(scenario, name).model_copy(update=changes)})


def facing(world, *poses):
    """The robots, standing at these poses."""
    world.reset(0)
    for each, pose in zip(world.worlds, poses, strict=True):
        each._robot.place(standing_at(pose))
    return world


def test_one_robot_drives_to_the_bit_as_in_a_world_of_its_own():
    noisy = part(HALLWAY, "lidar", noise_deviation_m=0.02)

    def seen_in(world, step):
        for tick in range(80):
            observation = step(Command(0.6, 0.5 * math.sin(tick)))
        return observation.pose, observation.people_position_m.tolist(), world.scan().tolist()

    with HallwayWorld(noisy, seed=5) as alone, SharedWorld(noisy, seed=5) as shared:
        alone.reset(1)
        shared.reset(1)
        one = seen_in(alone, alone.step)
        assert one == seen_in(shared.worlds[0], lambda command: shared.step([command])[0])


def test_robots_observe_the_same_people_and_each_other_among_them():
    with SharedWorld(HALLWAY, seed=5, robots=3) as shared:
        shared.reset(0)
        for _ in range(20):
            seen = shared.step([Command(0.5, 0.0), Command(0.3, 0.2), STOP])
    n_people = HALLWAY.pedestrians.count
    for number, observation in enumerate(seen):
        people, others = observation.people_position_m[:n_people], observation.people_id[n_people:]
        assert np.array_equal(people, seen[0].people_position_m[:n_people])
        assert others.tolist() == [n_people + each for each in range(3) if each != number]
        for row, other in enumerate(others - n_people, n_people):
            assert np.allclose(observation.people_position_m[row], seen[other].pose[:2], atol=1e-6)
            speed_mps = float(np.hypot(*observation.people_velocity_mps[row]))
            assert speed_mps == pytest.approx(abs(seen[other].speed_mps), abs=1e-6)


def test_a_scan_meets_the_hull_of_the_other_robot():
    with SharedWorld(EMPTY, seed=1, robots=2) as shared:
        facing(shared, (1.0, 6.0, math.pi / 2), (1.0, 8.0, 0.0))
        first, second = shared.worlds
        first.observe()
        angles_rad = first._lidar.angles_rad
        assert first.scan()[np.argmin(np.abs(angles_rad))] == pytest.approx(
            2.0 - RADIUS_M, abs=1e-3
        )
        hit = np.abs(angles_rad) < math.asin(RADIUS_M / 2.0)
        second._robot.place(standing_at((1.0, 18.0, 0.0)))
        first.observe()
        assert (first.scan()[hit] > 2.5).all()


def test_robots_that_drive_at_each_other_touch_and_stand():
    with SharedWorld(EMPTY, seed=1, robots=2) as shared:
        facing(shared, (1.0, 6.0, math.pi / 2), (1.0, 8.0, -math.pi / 2))
        for _ in range(100):
            seen = shared.step([Command(0.5, 0.0)] * 2)
            assert math.dist(seen[0].pose[:2], seen[1].pose[:2]) >= 2 * RADIUS_M - 1e-9
        assert math.dist(seen[0].pose[:2], seen[1].pose[:2]) < 2 * RADIUS_M + 0.05
        assert [each.speed_mps for each in seen] == [0.0, 0.0]
        assert [each.others.n_contacts for each in shared.worlds] == [1, 1]
        for _ in range(20):
            seen = shared.step([Command(-0.3, 0.0), Command(0.0, 0.5)])
        assert seen[0].speed_mps < 0.0
        assert seen[1].yaw_rad != pytest.approx(-math.pi / 2)
        shared.reset(1)
        assert [each.others.n_contacts for each in shared.worlds] == [0, 0]


def test_people_are_pushed_by_each_robot():
    """With a robot on either side the forces on a person are the sums of both."""
    with HallwayWorld(HALLWAY.with_pedestrian_count(1), seed=2) as world:
        world.reset(0)
        crowd = world._running()
        here = float(crowd.x_m[0]), float(crowd.y_m[0])
    bodies = [RobotBody(here[0] + away, here[1], 0.0, 0.0, RADIUS_M) for away in (0.8, -0.9)]

    def force(*robots):
        crowd._fluctuation_mps2 = 0.0
        return np.array(crowd._forces(robots))

    nobody = RobotBody(1e6, 1e6, 0.0, 0.0, 0.0)
    pushes = [force(body) - force(nobody) for body in bodies]
    assert all(np.abs(push).max() > 1e-3 for push in pushes)
    assert force(*bodies) == pytest.approx(force(nobody) + sum(pushes), rel=1e-12)


def test_two_robots_that_change_places_avoid_each_other():
    """Each planner has the other robot among its people; both have the same plans for a while."""
    ends = Waypoint(1.0, 4.0), Waypoint(1.0, 12.0)
    with SharedWorld(EMPTY, seed=3, robots=2) as shared:
        facing(shared, (1.0, 4.0, math.pi / 2), (1.0, 12.0, -math.pi / 2))
        seen = [world.observe() for world in shared.worlds]
        planners = [make_planner("dwa", EMPTY) for _ in seen]
        for _ in range(720):
            plans = zip(planners, seen, reversed(ends), strict=True)
            seen = shared.step([planner.step(each, goal) for planner, each, goal in plans])
        for observation, goal in zip(seen, reversed(ends), strict=True):
            assert math.dist(observation.pose[:2], (goal.x_m, goal.y_m)) < 0.5
        for world in shared.worlds:
            assert world.others.n_contacts == 0
            assert 0.0 < world.others.minimum_distance_m < 1.0


def test_robots_start_apart_and_a_small_area_has_room_for_few():
    with SharedWorld(EMPTY, seed=1, robots=3) as shared:
        for episode in range(20):
            places = [each.pose[:2] for each in shared.reset(episode)]
            gaps = [math.dist(a, b) for a in places for b in places if a is not b]
            assert min(gaps) >= 2 * RADIUS_M + 0.5
    with (
        SharedWorld(EMPTY, seed=1, robots=20) as crowded,
        pytest.raises(
            SerdError, match=r"start area 'train' must have room for \d+ robots 1 m apart"
        ),
    ):
        crowded.reset(0)


@pytest.mark.parametrize(
    ("scenario", "sentence"),
    [
        (partial(part, name="robot", drive="physical"), "drive kinematic .* got drive: physical"),
        (partial(part, name="robot", radius_m=0.3), r"at most the radius of a person .*, got 0\.3"),
    ],
)
def test_worlds_that_robots_cannot_share_are_refused(scenario, sentence):
    with pytest.raises(SerdError, match=sentence):
        SharedWorld(scenario(HALLWAY), seed=1, robots=2)
