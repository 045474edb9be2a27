"""People of standard message types, by the definitions in the bag."""

import numpy as np
import pytest

from serd_app.demonstrations.flow_field import flow_from_recordings, recorded_sightings
from serd_app.drives.people import SightedIds, people_of
from serd_app.drives.recording import Recording
from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_core.grid.grid import Grid
from support.bag_messages import TF, Messages, write_bag
from support.people_messages import CLOUD, DETECTIONS, PEOPLE, TRACKED, PeopleMessages

MADE = PeopleMessages()
GRID = Grid((0.0, 0.0), 1.0, np.ones((6, 6), dtype=bool))
#: Turns by 90 degrees and moves.
CAMERA_IN_MAP = Messages().transform(100.0, "map", "camera", 2.0, 3.0, np.pi / 2)


def walk(step):
    """Positions and velocities of three people at a step of 0.1 s."""
    velocity = np.array([[1.0, 0.0], [0.0, 0.8], [-0.5, 0.5]])
    start = np.array([[0.5, 0.5], [5.5, 0.5], [4.5, 1.5]])
    return start + 0.1 * step * velocity, velocity


def bag(folder, kind, *, steps=range(40), made=MADE, **look):
    topics = {"/tf_static": TF, "/people": made.kind(kind) if kind != CLOUD else kind}
    rows = [("/tf_static", 100.0, CAMERA_IN_MAP)]
    rows += [
        ("/people", 100.0 + step / 10, made.encode(kind, 100.0 + step / 10, *walk(step), **look))
        for step in steps
    ]
    return write_bag(folder, topics, rows)


def recorded_people(path, frame=""):
    """(N, 2) positions and velocities of all sightings."""
    found = recorded_sightings(BagReader(path), "people", frame=frame)
    columns = zip(*((one.people.position_m, one.people.velocity_mps) for one in found), strict=True)
    return [np.concatenate(column)[:, :2] for column in columns]


@pytest.mark.parametrize("kind", [PEOPLE, TRACKED, DETECTIONS])
def test_people_of_each_type_are_those_of_our_topic_to_a_millimetre(tmp_path, kind):
    paths = bag(tmp_path / "own", CLOUD), bag(tmp_path / "other", kind)
    own, other = map(recorded_people, paths)
    np.testing.assert_allclose(other[0], own[0], atol=1e-3)
    # A detection has no velocity: it begins with the second sighting.
    known = slice(3 if kind == DETECTIONS else 0, None)
    np.testing.assert_allclose(other[1][known], own[1][known], atol=1e-3)
    flows = [flow_from_recordings([Recording(path, ())], GRID, "people") for path in paths]
    assert flows[0].flow.tolist() == flows[1].flow.tolist()


@pytest.mark.parametrize("kind", [CLOUD, PEOPLE, TRACKED, DETECTIONS])
def test_people_in_the_frame_of_a_sensor_are_brought_into_that_of_the_grid(tmp_path, kind):
    path = bag(tmp_path / "bag", kind, frame="camera")
    position_m, velocity_mps = recorded_people(path, frame="map")
    places = np.concatenate([walk(step)[0] for step in range(40)])
    placed = np.stack([2.0 - places[:, 1], 3.0 + places[:, 0]], axis=1)
    np.testing.assert_allclose(position_m, placed, atol=1e-3)
    np.testing.assert_allclose(velocity_mps[3], [0.0, 1.0], atol=1e-3)


def test_a_frame_that_no_transform_joins_gets_a_sentence(tmp_path):
    path = bag(tmp_path / "bag", PEOPLE, frame="lidar")
    with pytest.raises(BagError, match="frame 'lidar' must be joined with 'map' by /tf"):
        recorded_people(path, frame="map")


@pytest.mark.parametrize(
    ("layout", "classes", "ids"),
    [
        *(("", name, ("p0", "p1", "p2")) for name in ("person", "Pedestrian", "0")),
        ("", "chair", ()),
        ("foxy", "person", ("p0", "p1", "p2")),
        ("foxy", "chair", ()),
        ("noetic", 0, ("", "", "")),
        ("noetic", 56, ()),
    ],
)
def test_detections_of_each_layout_are_read_and_other_classes_left_out(
    tmp_path, layout, classes, ids
):
    made = PeopleMessages(layout) if layout else MADE
    path = bag(tmp_path / "bag", DETECTIONS, steps=[0], made=made, classes=classes)
    np.testing.assert_allclose(recorded_people(path)[0], walk(0)[0][: len(ids)])
    assert people_of(made.message(DETECTIONS, 1.0, *walk(0), classes=classes)).ids == ids


def test_a_velocity_is_taken_over_half_a_second_and_a_repeated_message_keeps_it():
    """Detectors are noisy: between two frames of a camera an error of 5 cm would be 1.5 m/s."""
    ids, made = SightedIds(), []
    for time_s, x_m in ((0.0, 0.0), (0.1, 0.3), (0.5, 0.5), (0.5, 0.5), (0.7, 0.5), (0.2, 0.0)):
        place, walk_mps = np.array([[x_m, 0.0]]), np.zeros((1, 2))
        seen = people_of(MADE.message(DETECTIONS, time_s, place, walk_mps))
        made.append(ids.with_velocities(seen, time_s).velocity_mps[0, 0])
    np.testing.assert_allclose(made, [np.nan, 3.0, 1.0, 1.0, 0.0, np.nan], atol=1e-9)
