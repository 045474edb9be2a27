"""Scenario files: what is built in, and what is refused with which sentence."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import yaml

import serd_sim.scenario.scenario
from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from serd_sim.drivers.catalogue import ScriptedExpert
from serd_sim.drivers.strategy import start_distribution
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import flow_of, grid_of, navigation_problem_of, wall_distance_of
from serd_sim.scenario.names import builtin_scenarios, scenario_suite, suite_names
from serd_sim.scenario.polygon import distance_to_segments_m
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld

SCENARIOS = Path(serd_sim.scenario.scenario.__file__).parent / "scenarios"


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("halway", "hallway"), ("social_v1/narow_doorway", "social_v1/narrow_doorway")],
)
def test_a_wrong_scenario_name_is_refused_with_the_nearest_right_one(name, nearest):
    with pytest.raises(USER_ERRORS, match=f"did you mean '{nearest}'"):
        load_scenario(name)


@pytest.mark.parametrize(
    ("part", "speed"), [("robot", {"max_vel_x_mps": 0.2}), ("local_planner", {"max_vel_x": 0.2})]
)
def test_a_robot_that_cannot_cross_a_cell_within_its_patience_gets_a_remark(part, speed):
    remark = load_scenario("corridor").with_values(part, **speed).patience_remark
    assert remark.startswith("at its full speed of 0.2 m/s the robot drives 0.8 m within patience")
    for name in builtin_scenarios():
        scenario = load_scenario(name)
        assert (scenario.name, scenario.patience_remark) == (name, "")


def test_free_space_lies_left_of_every_wall_whatever_the_order_of_corners(tmp_path):
    pillar = one_obstacle([3, 3], [4, 3], [4, 4], [3, 4])
    place = {"walkable_area_m": ROOM[::-1], "obstacles": pillar, "pedestrians": {"count": 0}}
    start, end = load_scenario(room(tmp_path, **place)).wall_segments_m.transpose(1, 0, 2)
    along = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    beside = 0.5 * (start + end) + 0.1 * np.stack([-along[:, 1], along[:, 0]], axis=1)
    assert ((beside > 0) & (beside < 10)).all()
    assert not ((beside > 3) & (beside < 4)).all(axis=1).any()


ROOM = [[0, 0], [10, 0], [10, 10], [0, 10]]
SQUARE = [[2, 2], [8, 2], [8, 8], [2, 8]]


def room(tmp_path, **values):
    """A room of 10 m with a loop, with some top-level values changed."""
    content = {
        "name": "room",
        "walkable_area_m": ROOM,
        "goal_area_m": [[7, 7], [9, 7], [9, 9], [7, 9]],
        "start_areas_m": {"train": TRAIN},
        "pedestrians": one_loop(SQUARE),
    }
    path = tmp_path / "room.yaml"
    path.write_text(yaml.safe_dump(content | values))
    return path


def one_loop(waypoints_m, **values):
    return {"count": 3, "loops": [{"name": "round", "waypoints_m": waypoints_m, **values}]}


def one_obstacle(*corners):
    return [{"name": "block", "outline_m": list(corners)}]


FAR_AWAY = [[20, 20], [22, 20], [22, 22], [20, 22]]
TRAIN = [[0, 0], [2, 0], [2, 2], [0, 2]]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"decision_period_s": 2.0}, "is not a known key; .* may have patience_s and wait_s"),
        ({"robot": {"acc_lim_x_mps2": 8.0}}, r"decel_lim_x_mps2 must be .* \(8\), .* raise it"),
        ({"goal_area_m": FAR_AWAY}, "goal_area_m must hold the centre of at least one walkable"),
        ({"pedestrians": one_loop([[1, 1], [12, 1], [1, 9]])},
         r"loops\[0\]\.waypoints_m must be in the walkable area, got \[12\.0, 1\.0"),
        ({"pedestrians": one_loop([[2, 2], [8, 2], [8, 2], [2, 8]])}, "remove the repeated"),
        ({"pedestrians": one_loop(SQUARE, lane_half_width_m=5.0)},
         r"got \[-3\.0, -3\.0\]; lower lane_half_width_m \(5\)"),
        ({"pedestrians": one_loop(SQUARE) | {"count": 3000}},
         r"pedestrians\.count must be at most 540 on 100 m2, .* got 3000; lower it"),
        ({"obstacles": one_obstacle([4, 1], [6, 1], [6, 3], [4, 3])},
         r"loops\[0\]\.waypoints_m must cross no wall, but the leg from \[2\.0, 2\.0\]"),
        ({"obstacles": one_obstacle([14, 14], [16, 14], [16, 16])},
         r"obstacles\[0\]\.outline_m must lie in the walkable area"),
        ({"obstacles": one_obstacle([-1, 4], [11, 4], [11, 6], [-1, 6]),
          "pedestrians": {"count": 0}}, r"goal_area_m must be reachable from start_areas_m\.train"),
        ({"start_areas_m": {"train": [[0, 0], [2, 2], [2, 0], [0, 2]]}}, "must not cross itself"),
        ({"start_areas_m": {"train": TRAIN, "other": [[7, 7], [9, 7], [9, 9], [7, 9]]}},
         r"start_areas_m\.other must keep clear of goal_area_m, .* cell at \[7\.5, 7\.5\]"),
        ({"robot": {"radius_m": 6.0}}, r"radius_m must leave room in walkable_area_m, .* got 6"),
        ({"lidar": {"range_min_m": 5.0, "range_max_m": 2.0}},
         r"lidar\.range_min_m must be below lidar\.range_max_m \(2\), got 5"),
        ({"robot": {"max_vel_x_mps": 6.0}}, r"below the 0\.0417 s in .* at 6 m/s, got 0\.05 s"),
        ({"episode_timeout_s": 0.01}, r"at least control_period_s \(0\.05 s\), got 0\.01 s"),
        ({"lidar": {"rate_hz": 3.0}}, r"the period of lidar\.rate_hz must be a whole number"),
        ({"cell_size_m": 0.001}, r"at most 40000 cells of the 10 m x 10 m .* raise it to 0\.05 "),
    ],
)  # fmt: skip
def test_a_place_where_nobody_could_walk_or_drive_is_refused_by_key(tmp_path, values, sentence):
    longest = {"control_period_s": 0.2, "lidar": {"rate_hz": 5.0}, "robot": {"max_vel_x_mps": 1.0}}
    assert load_scenario(room(tmp_path, **longest)).ticks_per_scan == 1
    with pytest.raises(USER_ERRORS, match=sentence):
        load_scenario(room(tmp_path, **values))


def with_door(tmp_path, low_m, high_m, **values):
    """Two rooms of 4.5 m with a door between two heights in a wall of 0.2 m."""
    walls = [
        {"name": "south", "outline_m": [[4.9, -1], [5.1, -1], [5.1, low_m], [4.9, low_m]]},
        {"name": "north", "outline_m": [[4.9, high_m], [5.1, high_m], [5.1, 11], [4.9, 11]]},
    ]
    people, robot = {"count": 0}, {"drive": "physical"}
    return room(tmp_path, obstacles=walls, pedestrians=people, robot=robot, **values)


def test_cells_are_walkable_where_the_robot_fits_and_are_entered_in_their_free_part(tmp_path):
    """A robot of 0.25 m that keeps 0.04 m from walls, in a door from 3.55 to 4.45 m."""
    cells = load_scenario(with_door(tmp_path, 3.55, 4.45, cell_size_m=0.8)).cells
    at_door = np.abs(cells.centers_m - (5.2, 4.0)).max(axis=1) < 0.5
    assert at_door.sum() == 2  # the door is half in each of two rows
    assert (np.abs(cells.middles_m[at_door, 1] - 4.0) < 0.2).all()
    walls_m = load_scenario(tmp_path / "room.yaml").wall_segments_m
    assert distance_to_segments_m(cells.middles_m, walls_m).min() > 0.28


@pytest.mark.parametrize("cell_size_m", [0.24, 0.2])
def test_fine_cells_away_from_walls_are_all_walkable(cell_size_m):
    hallway = load_scenario("hallway").model_copy(update={"cell_size_m": cell_size_m})
    x_m, y_m = np.meshgrid(np.arange(0.6, 5.4, 0.1), np.arange(0.6, 23.4, 0.1))
    grid = grid_of(hallway)
    assert all(grid.state_at(*point) >= 0 for point in zip(x_m.flat, y_m.flat, strict=True))


@pytest.mark.parametrize("high_m", [4.0, 4.09])
def test_a_way_that_is_too_narrow_is_refused_with_its_width_and_place(tmp_path, high_m):
    sentence = rf"the way is 0\.{round(100 * (high_m - 3.5))} m wide at \(\d\.\d+, 3\.[78]\d\) m"
    with pytest.raises(USER_ERRORS, match=sentence + r", and the robot needs 0\.60 m; widen it"):
        load_scenario(with_door(tmp_path, 3.5, high_m))


@pytest.mark.parametrize(
    ("low_m", "width_m", "cell_size_m"), [(3.55, 0.9, 0.8), (6.13, 0.7, 0.5), (2.41, 1.13, 1.0)]
)
def test_a_robot_drives_through_a_door_wherever_it_is(tmp_path, low_m, width_m, cell_size_m):
    place = with_door(tmp_path, low_m, low_m + width_m, cell_size_m=cell_size_m)
    scenario = load_scenario(place)
    with HallwayWorld(scenario, seed=2) as world:
        driver, planner = ScriptedExpert(scenario, 2), make_planner(scenario)
        record = run_episode(world, planner, driver, episode=0, timeout_s=60.0)
    assert (record.outcome, record.contacts.robot_on_wall) == ("arrived", 0)


def test_a_prediction_begins_where_the_robot_does_away_from_walls(tmp_path):
    """Of the start area's four cells only the one away from both walls has room for 0.4 m."""
    scenario = load_scenario(room(tmp_path, robot={"radius_m": 0.4}))
    with HallwayWorld(scenario, seed=1) as world:
        starts = [world.reset(episode) for episode in range(8)]
    (states,) = np.nonzero(start_distribution(scenario, "train"))
    grid = navigation_problem_of(scenario, 0.99).grid
    assert {grid.state_at(each.x_m, each.y_m) for each in starts} == set(states)
    assert list(states) == [grid.state_at(1.5, 1.5)]


#: A suite never changes: another scenario, or an edited one, is another suite.
FROZEN = {"social_v1": "8e61eb9b74d83828"}


@pytest.mark.parametrize("suite", suite_names())
def test_a_suite_is_frozen_and_its_scenarios_load_by_their_names(suite):
    names = scenario_suite(suite)
    assert len(names) >= 12
    assert [f"{suite}/{load_scenario(name).name}" for name in names] == list(names)
    content = b"".join((SCENARIOS / f"{name}.yaml").read_bytes() for name in names)
    assert hashlib.sha256(content).hexdigest()[:16] == FROZEN[suite]
    assert scenario_suite("hallway") == ()


HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


def test_people_keep_right_and_make_no_flow_where_there_are_none():
    flow = flow_of(HALLWAY, GRID)
    for *place, expected in (
        (4.5, 8.5, Action.NORTH),
        (1.5, 8.5, Action.SOUTH),
        (9.5, 16.5, Action.EAST),
        (9.5, 19.5, Action.WEST),
    ):
        assert flow[GRID.state_at(*place)] == expected
    assert (flow_of(HALLWAY.with_pedestrian_count(0), GRID) == -1).all()


def test_wall_distances_are_those_of_the_centres_of_cells():
    distance_m = wall_distance_of(HALLWAY, GRID)
    assert distance_m[[GRID.state_at(x_m, 10.5) for x_m in (2.5, 0.5)]] == pytest.approx([2.5, 0.5])
