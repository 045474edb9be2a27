"""Scenario files: what is built in, and what is refused with which sentence."""

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

import serd_sim.scenario.scenario
from serd_files.errors import USER_ERRORS
from serd_sim.drivers.strategy import start_distribution
from serd_sim.scenario.grid import grid_of, navigation_problem_of
from serd_sim.scenario.names import builtin_scenarios, scenario_suite, suite_names
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.world import HallwayWorld

HALLWAY = Path(serd_sim.scenario.scenario.__file__).parent / "scenarios" / "hallway.yaml"


def test_a_scenario_by_path_equals_the_built_in_one(tmp_path):
    path = tmp_path / "copy.yaml"
    shutil.copy(HALLWAY, path)
    assert load_scenario(path) == load_scenario("hallway")


def test_the_hallway_is_6_by_24_metres_with_24_people():
    scenario = load_scenario("hallway")
    outline = np.array(scenario.walkable_area_m)
    assert outline[:, 1].min() == 0
    assert outline[:, 1].max() == 24
    assert scenario.pedestrians.count == 24
    assert (scenario.patience_s, scenario.wait_s) == (4.0, 1.0)


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("halway", "hallway"), ("social_v1/narow_doorway", "social_v1/narrow_doorway")],
)
def test_a_wrong_scenario_name_is_refused_with_the_nearest_right_one(name, nearest):
    with pytest.raises(USER_ERRORS, match=f"did you mean '{nearest}'"):
        load_scenario(name)


@pytest.mark.parametrize("name", builtin_scenarios())
def test_every_built_in_scenario_loads_and_its_robot_crosses_a_cell_within_its_patience(name):
    scenario = load_scenario(name)
    assert (scenario.name, scenario.patience_remark) == (name, "")


@pytest.mark.parametrize("slow", ["robot", "local_planner"])
def test_a_robot_that_cannot_cross_a_cell_within_its_patience_gets_a_remark(slow):
    speed = {"robot": {"max_vel_x_mps": 0.2}, "local_planner": {"max_vel_x": 0.2}}[slow]
    remark = load_scenario("corridor").with_values(slow, **speed).patience_remark
    assert remark.startswith(
        "at its full speed of 0.2 m/s the robot drives 0.8 m within patience_s = 4 s, less than a"
        " cell of 1 m: raise patience_s"
    )


def test_left_hand_traffic_walks_the_loops_backwards():
    right = load_scenario("hallway")
    left = right.model_copy(update={"flow_convention": "left_hand"})
    first_right, first_left = right.directed_loops[0], left.directed_loops[0]
    assert first_left.waypoints_m == first_right.waypoints_m[::-1]


def test_free_space_lies_left_of_every_wall_whatever_the_order_of_corners():
    square = [(0.0, 0.0), (0.0, 8.0), (8.0, 8.0), (8.0, 0.0)]
    pillar = [(3.0, 3.0), (4.0, 3.0), (4.0, 4.0), (3.0, 4.0)]
    scenario = Scenario(
        name="square",
        walkable_area_m=square,
        obstacles=[{"name": "pillar", "outline_m": pillar}],
        goal_area_m=[(6, 6), (8, 6), (8, 8), (6, 8)],
        start_areas_m={"train": [(0, 0), (2, 0), (2, 2), (0, 2)]},
        pedestrians={"count": 0},
    )
    start, end = scenario.wall_segments_m[:, 0], scenario.wall_segments_m[:, 1]
    along = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    beside = 0.5 * (start + end) + 0.1 * np.stack([-along[:, 1], along[:, 0]], axis=1)
    free = (beside > 0).all(axis=1) & (beside < 8).all(axis=1)
    in_pillar = ((beside > 3) & (beside < 4)).all(axis=1)
    assert free.all()
    assert not in_pillar.any()


ROOM = [[0, 0], [10, 0], [10, 10], [0, 10]]
SQUARE = [[2, 2], [8, 2], [8, 8], [2, 8]]


def room(tmp_path, **values):
    """A room of 10 m with a loop, with some top-level values changed."""
    content = {
        "name": "room",
        "walkable_area_m": ROOM,
        "goal_area_m": [[7, 7], [9, 7], [9, 9], [7, 9]],
        "start_areas_m": {"train": [[0, 0], [2, 0], [2, 2], [0, 2]]},
        "pedestrians": {"count": 3, "loops": [{"name": "round", "waypoints_m": SQUARE}]},
    }
    path = tmp_path / "room.yaml"
    path.write_text(yaml.safe_dump(content | values))
    return path


def one_loop(waypoints_m, **values):
    return {"count": 3, "loops": [{"name": "round", "waypoints_m": waypoints_m, **values}]}


def one_obstacle(*corners):
    return [{"name": "block", "outline_m": list(corners)}]


def test_the_longest_control_period_is_allowed(tmp_path):
    values = {"control_period_s": 0.2, "lidar": {"rate_hz": 5.0}, "robot": {"max_vel_x_mps": 1.0}}
    assert load_scenario(room(tmp_path, **values)).ticks_per_scan == 1


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"robot": {"radius": 0.3}}, r"robot\.radius.*did you mean 'radius_m'"),
        (
            {"decision_period_s": 2.0},
            r"decision_period_s is not a known key; .* may have patience_s and wait_s",
        ),
        (
            {"patience_s": 0.01},
            r"patience_s must be at least control_period_s \(0\.05 s\), got 0\.01 s; raise it",
        ),
        ({"wait_s": 0.04}, r"wait_s must be at least control_period_s \(0\.05 s\), got 0\.04 s"),
        ({"wait_s": 0.0}, r"wait_s must be greater than 0, got 0"),
        (
            {"robot": {"acc_lim_x_mps2": 8.0}},
            r"decel_lim_x_mps2 must be at least .* \(8\), .* raise it",
        ),
        (
            {"goal_area_m": [[20, 20], [22, 20], [22, 22], [20, 22]]},
            "goal_area_m must hold the centre of at least one walkable",
        ),
        (
            {"start_areas_m": {"train": [[0, 0], [0.4, 0], [0.4, 0.4], [0, 0.4]]}},
            r"start_areas_m\.train must hold the centre of at least one walkable",
        ),
        (
            {"pedestrians": one_loop([[1, 1], [12, 1], [1, 9]])},
            r"loops\[0\]\.waypoints_m must be in the walkable area, got \[12\.0, 1\.0",
        ),
        (
            {"pedestrians": one_loop([[2, 2], [8, 2], [8, 2], [2, 8]])},
            r"loops\[0\]\.waypoints_m: waypoints_m must differ .*; remove the repeated waypoint",
        ),
        (
            {"pedestrians": one_loop(SQUARE, lane_half_width_m=5.0)},
            r"edge of the lane of pedestrians\.loops\[0\] must be in the walkable area, got "
            r"\[-3\.0, -3\.0\]; lower lane_half_width_m \(5\)",
        ),
        (
            {"obstacles": one_obstacle([4, 1], [6, 1], [6, 3], [4, 3])},
            r"loops\[0\]\.waypoints_m must cross no wall, but the leg from \[2\.0, 2\.0\]",
        ),
        (
            {"obstacles": one_obstacle([14, 14], [16, 14], [16, 16])},
            r"obstacles\[0\]\.outline_m must lie in the walkable area",
        ),
        (
            {"obstacles": one_obstacle([4, np.nan], [6, 4], [5, 5])},
            r"obstacles\[0\]\.outline_m\[0\]\[1\] must be a finite number, got nan",
        ),
        (
            {
                "obstacles": one_obstacle([-1, 4], [11, 4], [11, 6], [-1, 6]),
                "pedestrians": {"count": 0},
            },
            r"goal_area_m must be reachable from start_areas_m\.train",
        ),
        (
            {"start_areas_m": {"train": [[0, 0], [2, 2], [2, 0], [0, 2]]}},
            r"start_areas_m\.train must not cross itself",
        ),
        ({"robot": {"radius_m": 6.0}}, r"whose robot\.radius_m is 6, got"),
        (
            {"lidar": {"range_min_m": 5.0, "range_max_m": 2.0}},
            r"lidar\.range_min_m must be below lidar\.range_max_m \(2\), got 5",
        ),
        (
            {"robot": {"max_vel_x_mps": 6.0}},
            r"below the 0\.0417 s in which the robot drives its own radius at 6 m/s, got 0\.05 s",
        ),
        (
            {
                "start_areas_m": {
                    "train": [[0, 0], [2, 0], [2, 2], [0, 2]],
                    "other": [[7, 7], [9, 7], [9, 9], [7, 9]],
                }
            },
            r"start_areas_m\.other must keep clear of goal_area_m, .* cell at \[7\.5, 7\.5\]",
        ),
        (
            {"episode_timeout_s": 0.01},
            r"episode_timeout_s must be at least control_period_s \(0\.05 s\), got 0\.01 s",
        ),
        (
            {"pedestrians": one_loop(SQUARE) | {"count": 3000}},
            r"pedestrians\.count must be at most 540 on 100 m2, .* got 3000; lower it",
        ),
        (
            {"cell_size_m": 0.001},
            r"cell_size_m must make at most 40000 cells of the 10 m x 10 m .* raise it to 0\.05 ",
        ),
        ({"lidar": {"rate_hz": 3.0}}, r"the period of lidar\.rate_hz must be a whole number"),
        ({"cell_size_m": 1e300}, r"cell_size_m must be at most 1e\+06 in size, got 1e\+300"),
    ],
)
def test_a_place_where_nobody_could_walk_or_drive_is_refused_by_key(tmp_path, values, sentence):
    with pytest.raises(USER_ERRORS, match=sentence):
        load_scenario(room(tmp_path, **values))


def test_a_robot_starts_only_in_cells_where_it_touches_no_wall(tmp_path):
    """Cells of half a metre beside a wall are too near for a robot of 0.25 m."""
    scenario = load_scenario(room(tmp_path, cell_size_m=0.5, pedestrians={"count": 0}))
    with HallwayWorld(scenario, seed=1) as world:
        for episode in range(40):
            start = world.reset(episode)
            assert min(start.x_m, start.y_m) >= scenario.robot.radius_m


def test_people_walk_the_same_however_finely_a_wall_is_cut(tmp_path):
    """Each edge pushes people, so that a wall in forty pieces pushed 2.8 times as hard."""
    shares = np.linspace(0.0, 1.0, 40, endpoint=False)[:, None]
    cut = [start + shares * (np.array(end) - start) for start, end in zip(
        np.array(ROOM, dtype=float), [*ROOM[1:], ROOM[0]], strict=True)]  # fmt: skip
    places = []
    for outline in (ROOM, np.concatenate(cut).tolist()):
        path = room(tmp_path, walkable_area_m=outline)
        with HallwayWorld(load_scenario(path), seed=1) as world:
            places.append(world.reset(0).people_position_m)
    np.testing.assert_array_equal(*places)


@pytest.mark.parametrize(
    ("edge_m", "walkable"), [(4.5, False), (4.45, False), (4.55, False), (4.62, True)]
)
def test_a_cell_whose_centre_is_on_a_wall_or_almost_is_not_walkable(tmp_path, edge_m, walkable):
    """The centre is at x = 4.5 m; a tenth of its cell is 0.1 m."""
    block = one_obstacle([edge_m, 4], [5.6, 4], [5.6, 6], [edge_m, 6])
    grid = grid_of(load_scenario(room(tmp_path, obstacles=block)))
    assert (grid.state_at(4.1, 4.5) >= 0) == walkable


def test_a_prediction_begins_where_the_robot_does(tmp_path):
    """Of the start area's four cells only the one away from both walls has room for 0.4 m."""
    scenario = load_scenario(room(tmp_path, robot={"radius_m": 0.4}))
    begun = set()
    with HallwayWorld(scenario, seed=1) as world:
        for episode in range(12):
            start = world.reset(episode)
            begun.add(world.grid.state_at(start.x_m, start.y_m))
    (states,) = np.nonzero(start_distribution(scenario, "train"))
    problem = navigation_problem_of(scenario, 0.99)
    assert begun == set(states) == {problem.grid.state_at(1.5, 1.5)}


#: A suite never changes: another scenario, or an edited one, is another suite.
FROZEN = {"social_v1": "8e61eb9b74d83828"}


def test_suites_hold_scenarios_that_load_by_their_names():
    for suite in suite_names():
        assert len(scenario_suite(suite)) >= 12
        for name in scenario_suite(suite):
            assert name == f"{suite}/{load_scenario(name).name}"
    assert scenario_suite("hallway") == ()


@pytest.mark.parametrize("suite", suite_names())
def test_a_suite_is_frozen(suite):
    folder = HALLWAY.parent
    content = b"".join((folder / f"{name}.yaml").read_bytes() for name in scenario_suite(suite))
    assert hashlib.sha256(content).hexdigest()[:16] == FROZEN[suite]
