"""The flow people walk in, from what was recorded of them, and its table."""

import array

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_app.demonstrations.grid.flow_field import (
    FlowEstimator,
    FlowField,
    flow_from_recordings,
    load_flow,
    save_flow,
)
from serd_app.drives.recorded_people import sightings_of_all
from serd_app.drives.recording import Recording
from serd_bag.damage import Losses
from serd_bag.errors import BagError, FileError
from serd_bag.messages.plain import decode, points_of
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Action, Grid

CLOUD = "sensor_msgs/msg/PointCloud2"
GRID = Grid((0.0, 0.0), 1.0, np.ones((1, 4), dtype=bool))
FIELDS = ("x", "y", "z", "vx", "vy")


def flow_of(recordings, topic="pedestrians"):
    sightings = sightings_of_all([each.bag for each in recordings], topic)
    return flow_from_recordings(recordings, sightings, GRID)


def point_cloud(data, names):
    return points_of(decode(data, CLOUD), names)


def cloud(messages, rows, *, names=FIELDS, big_endian=False):
    """A cloud of float32 fields with those names."""
    kind = ">f4" if big_endian else "<f4"
    data = np.array(rows, dtype=kind)
    fields = [
        messages.make("sensor_msgs/msg/PointField", name, 4 * index, 7, 1)
        for index, name in enumerate(names)
    ]
    step = 4 * len(names)
    content = np.frombuffer(data.tobytes(), dtype=np.uint8)
    message = messages.make(
        CLOUD, messages.header(1.0), 1, len(rows), fields, big_endian, step, step * len(rows),
        content, True,
    )  # fmt: skip
    return messages.encode(message, CLOUD)


@pytest.mark.parametrize("big_endian", [False, True])
def test_named_fields_read_as_written(messages, big_endian):
    data = cloud(messages, [[1, 2, 0, 3, 4], [5, 6, 0, 7, 8]], big_endian=big_endian)
    fields = point_cloud(data, ("vx", "x"))
    assert fields["x"].tolist() == [1, 5]
    assert fields["vx"].tolist() == [3, 7]
    assert array.array("d", point_cloud(data, ("vy",))["vy"]).tolist() == [4, 8]


def test_a_wrong_cloud_gets_a_sentence(messages):
    data = cloud(messages, [[1, 2]], names=("x", "y"))
    with pytest.raises(BagError, match="must have the field vx, got x, y"):
        point_cloud(data, ("x", "vx"))
    for length in range(4, len(data) - 1):
        with pytest.raises(BagError, match="must"):
            point_cloud(data[:length], ("x",))


def test_each_cell_gets_the_direction_its_people_walk_in():
    estimator = FlowEstimator(GRID)
    rng = np.random.default_rng(1)
    for _ in range(50):
        x = np.arange(4) + rng.uniform(0, 1, 4)
        noise = rng.normal(0, 0.2, (4, 2))
        sign = 1 if rng.random() < 0.5 else -1
        velocity = np.array([[1, 0], [0, -1], [sign, 0], [0, 1]]) + noise
        estimator.add(np.stack([x, np.full(4, 0.5)], axis=1)[:3], velocity[:3])
    field = estimator.field()
    assert field.flow.tolist() == [Action.EAST, Action.SOUTH, -1, -1]
    assert field.count.tolist() == [50, 50, 50, 0]
    assert field.order[0] > 0.9 > 0.5 > field.order[2]
    np.testing.assert_allclose(field.mean_velocity_mps[1], [0, -1], atol=0.1)
    assert estimator.field(minimum_count=51).flow.tolist() == [-1] * 4


def test_strays_and_strange_numbers_are_left_out():
    estimator = FlowEstimator(GRID)
    places = np.array([[9.0, 9.0], [np.nan, 0.5], [0.5, 0.5]])
    estimator.add(places, np.array([[1.0, 0.0], [1.0, 0.0], [np.inf, 0.0]]))
    assert estimator.field().count.sum() == 0


@pytest.fixture
def people_bag(tmp_path, messages):
    """Makes a bag of two people who walk on the spot, seen 15 times."""

    def make(name, topic="/pedestrians", begins_ns=0):
        with BagWriter(tmp_path / name) as writer:
            writer.add_topic(topic, CLOUD)
            for number in range(15):
                rows = [[0.5, 0.5, 0, -1, 0], [3.5, 0.5, 0, 0, 1]]
                writer.write(topic, cloud(messages, rows), begins_ns + number)
        return Recording(tmp_path / name, (), (), Losses())

    return make


def test_the_flow_is_added_up_over_all_bags_that_hold_people(people_bag):
    one, two, other = (
        people_bag("one"),
        people_bag("two", begins_ns=99),
        people_bag("other", "/crowd"),
    )
    assert flow_of([one]).flow.tolist() == [-1] * 4  # too few sightings
    found = flow_of([one, other, two])
    assert found.flow.tolist() == [Action.WEST, -1, -1, Action.NORTH]
    assert found.count.tolist() == [30, 0, 0, 30]
    assert flow_of([one, other, two, one]).count.tolist() == [30, 0, 0, 30]
    assert flow_of([other]) is None
    assert flow_of([other], "crowd").count.sum() == 30


def test_people_of_another_message_type_are_refused(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/pedestrians", "geometry_msgs/msg/Twist")
    with pytest.raises(
        BagError, match="on /pedestrians must be of type sensor_msgs/msg/PointCloud2"
    ):
        sightings_of_all([tmp_path / "bag"], "pedestrians")


TABLE_GRID = Grid((-1.0, 2.0), 0.5, np.array([[True, False, True], [True, True, True]]))


def save(path, grid, flow):
    zeros = np.zeros(grid.n_states, dtype=int)
    velocity = np.zeros((grid.n_states, 2))
    save_flow(path, grid, FlowField(flow, velocity, zeros, zeros))


@settings(deadline=None)
@given(arrays(bool, (3, 4)).filter(lambda cells: cells.any()), st.data())
def test_the_table_gives_back_the_flow(tmp_path_factory, walkable, data):
    grid = Grid((0.1, -7.3), 0.3, walkable)
    directions = st.sampled_from([-1, 1, 2, 3, 4])
    flow = np.array([data.draw(directions) for _ in range(grid.n_states)])
    path = tmp_path_factory.mktemp("flow") / "flow.csv"
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
