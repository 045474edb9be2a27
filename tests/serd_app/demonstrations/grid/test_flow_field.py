"""The flow people walk in, from what was recorded of them, and its table."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_app.demonstrations.decision_table import FlowField, load_flow, save_flow
from serd_app.demonstrations.flow_field import flow_from_recordings, flow_of_people
from serd_app.drives.recording import Recording
from serd_bag.errors import BagError, FileError
from serd_bag.messages.plain import decode, points_of
from serd_core.grid.grid import Action, Grid
from support.bag_messages import write_bag
from support.people_messages import CLOUD, PeopleMessages

GRID = Grid((0.0, 0.0), 1.0, np.ones((1, 4), dtype=bool))
MADE = PeopleMessages()


def flow_of(recordings, topic="pedestrians"):
    return flow_from_recordings(recordings, GRID, topic)


@pytest.mark.parametrize("big_endian", [False, True])
def test_named_fields_of_a_cloud_read_as_written_and_missing_ones_get_a_sentence(big_endian):
    cloud = MADE.message(CLOUD, 1.0, np.array([[1, 2], [5, 6]]), np.array([[3, 4], [7, 8]]))
    cloud.is_bigendian = big_endian
    if big_endian:
        cloud.data = cloud.data.view("<f4").astype(">f4").view(np.uint8)
    data = bytes(MADE.store.serialize_cdr(cloud, CLOUD))
    fields = points_of(decode(data, CLOUD), ("vx", "x", "vy"))
    assert [fields[name].tolist() for name in ("x", "vx", "vy")] == [[1, 5], [3, 7], [4, 8]]
    with pytest.raises(BagError, match="must have the field vz, got x, y, vx, vy"):
        points_of(decode(data, CLOUD), ("x", "vz"))
    for length in range(4, len(data) - 1, 7):
        with pytest.raises(BagError, match="must"):
            points_of(decode(data[:length], CLOUD), ("x",))


def test_each_cell_gets_the_direction_its_people_walk_in_if_they_walk_in_one():
    rng, moves = np.random.default_rng(1), [[1, 0], [0, -1]]
    places = np.stack([np.arange(3) + rng.uniform(0, 1, (50, 3)), np.full((50, 3), 0.5)], axis=2)
    velocity = np.array([[*moves, [rng.choice([1, -1]), 0]] for _ in range(50)])
    strays = np.array([[9.0, 9.0], [np.nan, 0.5], [0.5, 0.5]])
    people = (
        np.concatenate([places.reshape(-1, 2), strays]),
        np.concatenate(
            [(velocity + rng.normal(0, 0.2, (50, 3, 2))).reshape(-1, 2),
             [[1.0, 0.0], [1.0, 0.0], [np.inf, 0.0]]]
        ),
    )  # fmt: skip
    field = flow_of_people(GRID, *people)
    assert field.flow.tolist() == [Action.EAST, Action.SOUTH, -1, -1]
    assert field.count.tolist() == [50, 50, 50, 0]
    assert field.order[0] > 0.9 > 0.5 > field.order[2]
    np.testing.assert_allclose(field.mean_velocity_mps[1], [0, -1], atol=0.1)
    assert flow_of_people(GRID, *people, minimum_count=51).flow.tolist() == [-1] * 4


@pytest.fixture
def people_bag(tmp_path):
    """Makes a bag of two people who walk on the spot, seen 15 times."""

    def make(name, topic="/pedestrians", begins_s=0.0):
        places, velocities = np.array([[0.5, 0.5], [3.5, 0.5]]), np.array([[-1, 0], [0, 1]])
        data = MADE.encode(CLOUD, 1.0, places, velocities)
        rows = ((topic, begins_s + row, data) for row in range(15))
        return Recording(write_bag(tmp_path / name, {topic: CLOUD}, rows), ())

    return make


def test_the_flow_is_added_up_over_all_bags_that_hold_people(people_bag):
    one, two = people_bag("one"), people_bag("two", begins_s=99.0)
    other = people_bag("other", "/crowd")
    assert flow_of([one]).flow.tolist() == [-1] * 4  # too few sightings
    for recordings in ([one, other, two], [one, other, two, one]):
        found = flow_of(recordings)
        assert found.flow.tolist() == [Action.WEST, -1, -1, Action.NORTH]
        assert found.count.tolist() == [30, 0, 0, 30]
    assert flow_of([other]) is None
    assert flow_of([other], "crowd").count.sum() == 30


def test_people_of_another_message_type_are_refused(tmp_path):
    bag = write_bag(tmp_path / "bag", {"/pedestrians": "geometry_msgs/msg/Twist"}, ())
    sentence = "on /pedestrians must be of type sensor_msgs/msg/PointCloud2"
    with pytest.raises(BagError, match=sentence):
        flow_of([Recording(bag, ())])


TABLE_GRID = Grid((-1.0, 2.0), 0.5, np.array([[True, False, True], [True, True, True]]))


def save(path, grid, flow):
    zeros = np.zeros((grid.n_states, 2), dtype=int)
    save_flow(path, grid, FlowField(flow, zeros, *zeros.T))


@settings(max_examples=30)
@given(arrays(bool, (3, 4)).filter(lambda cells: cells.any()), st.data())
def test_the_table_gives_back_the_flow(tmp_path_factory, walkable, data):
    grid = Grid((0.1, -7.3), 0.3, walkable)
    directions = st.sampled_from([-1, 1, 2, 3, 4])
    flow = np.array([data.draw(directions) for _ in range(grid.n_states)])
    path = tmp_path_factory.getbasetemp() / "flow.csv"
    save(path, grid, flow)
    assert load_flow(path, grid).tolist() == flow.tolist()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda _: "", "must have the columns state, x_m, y_m, flow, order, count, vx_mps, vy_mps,"
         " got none"),
        (lambda text: text.replace("north", "nort"), "line 2, flow must be a direction or none,"
         " got 'nort'; did you mean 'north'?"),
        (lambda text: text.replace("-0.75,", "9.0,", 1), "line 2 must be the cell at"),
        (lambda text: text.rsplit("\n", 2)[0], "must have one line for each of the grid's 5"),
    ],
)  # fmt: skip
def test_a_table_that_does_not_fit_gets_a_sentence(tmp_path, change, sentence):
    path = tmp_path / "flow.csv"
    save(path, TABLE_GRID, np.array([1, 2, 3, 4, -1]))
    path.write_text(change(path.read_text()))
    with pytest.raises(FileError, match="flow") as caught:
        load_flow(path, TABLE_GRID)
    assert sentence in str(caught.value)
