"""People of standard message types, by the definitions in the bag, and their tracks."""

import numpy as np
import pytest

from serd_app.demonstrations.grid.flow_field import flow_from_recordings
from serd_app.drives.recorded_people import (
    Sighting,
    crowd_of_sightings,
    recorded_sightings,
    sightings_of_all,
    tracks_of_sightings,
)
from serd_app.drives.recording import Recording
from serd_app.errors import AppError
from serd_bag.damage import Losses
from serd_bag.errors import BagError
from serd_bag.messages.people import SeenPeople, SightedIds, people_of
from serd_bag.messages.plain import Header
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Grid
from support.bag_messages import TF, Messages
from support.people_messages import CLOUD, DETECTIONS, PEOPLE, TRACKED, PeopleMessages

MADE = PeopleMessages()
GRID = Grid((0.0, 0.0), 1.0, np.ones((6, 6), dtype=bool))


def walk(step):
    """Positions and velocities of three people at a step of 0.1 s."""
    velocity = np.array([[1.0, 0.0], [0.0, 0.8], [-0.5, 0.5]])
    start = np.array([[0.5, 0.5], [5.5, 0.5], [4.5, 1.5]])
    return start + 0.1 * step * velocity, velocity


def bag(folder, kind, *, frame="map", transform=None, **look):
    with BagWriter(folder) as writer:
        writer.add_topic("/people", MADE.kind(kind) if kind != CLOUD else kind)
        if transform is not None:
            writer.add_topic("/tf_static", TF)
            writer.write("/tf_static", transform, 10**11)
        for step in range(40):
            time_s = 100.0 + 0.1 * step
            data = MADE.encode(kind, time_s, *walk(step), frame=frame, **look)
            writer.write("/people", data, round(time_s * 1e9))
    return folder


def recorded_people(path, frame=""):
    """(N, 2) positions and velocities of all sightings."""
    found = recorded_sightings(BagReader(path), "people", frame=frame)
    return (
        np.concatenate([each.people.position_m[:, :2] for each in found]),
        np.concatenate([each.people.velocity_mps[:, :2] for each in found]),
    )


def turned(x, y):
    """A static transform that turns by 90 degrees and moves."""
    return Messages().transform(100.0, "map", "camera", x, y, np.pi / 2)


@pytest.mark.parametrize("kind", [PEOPLE, TRACKED, DETECTIONS])
def test_people_of_each_type_are_those_of_our_topic_to_a_millimetre(tmp_path, kind):
    own = recorded_people(bag(tmp_path / "own", CLOUD))
    found = recorded_people(bag(tmp_path / "other", kind))
    np.testing.assert_allclose(found[0], own[0], atol=1e-3)
    # A detection has no velocity: it begins with the second sighting.
    known = slice(3 if kind == DETECTIONS else 0, None)
    np.testing.assert_allclose(found[1][known], own[1][known], atol=1e-3)
    recordings = [Recording(tmp_path / name, (), (), Losses()) for name in ("own", "other")]
    sightings = sightings_of_all([each.bag for each in recordings], "people")
    flows = [
        flow_from_recordings([each], [people], GRID).flow
        for each, people in zip(recordings, sightings, strict=True)
    ]
    assert flows[0].tolist() == flows[1].tolist()


@pytest.mark.parametrize("kind", [CLOUD, PEOPLE, TRACKED, DETECTIONS])
def test_people_in_the_frame_of_a_sensor_are_brought_into_that_of_the_grid(tmp_path, kind):
    path = bag(tmp_path / "bag", kind, frame="camera", transform=turned(2.0, 3.0))
    position_m, velocity_mps = recorded_people(path, frame="map")
    places = np.concatenate([walk(step)[0] for step in range(40)])
    np.testing.assert_allclose(
        position_m, np.stack([2.0 - places[:, 1], 3.0 + places[:, 0]], axis=1), atol=1e-3
    )
    np.testing.assert_allclose(velocity_mps[3], [0.0, 1.0], atol=1e-3)


def test_a_frame_that_no_transform_joins_gets_a_sentence(tmp_path):
    path = bag(tmp_path / "bag", PEOPLE, frame="lidar", transform=turned(0.0, 0.0))
    with pytest.raises(BagError, match="frame 'lidar' must be joined with 'map' by /tf"):
        recorded_people(path, frame="map")


def test_detections_of_other_classes_are_left_out():
    place, velocity = walk(0)
    for name, count in (("person", 3), ("Pedestrian", 3), ("0", 3), ("chair", 0)):
        message = MADE.message(DETECTIONS, 1.0, place, velocity, classes=name)
        assert len(people_of(message).ids) == count


@pytest.mark.parametrize(
    ("layout", "person", "other", "ids"),
    [("foxy", "person", "chair", ("p0", "p1", "p2")), ("noetic", 0, 56, ("", "", ""))],
)
def test_detections_of_older_layouts_are_read(tmp_path, layout, person, other, ids):
    made, walks = PeopleMessages(layout), walk(0)
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/people", made.kind(DETECTIONS))
        writer.write("/people", made.encode(DETECTIONS, 1.0, *walks, classes=person), 10**9)
    position_m, _ = recorded_people(tmp_path / "bag")
    np.testing.assert_allclose(position_m, walks[0])
    found = [
        people_of(made.message(DETECTIONS, 1.0, *walks, classes=name)).ids
        for name in (person, other)
    ]
    assert found == [ids, ()]


def test_an_id_that_was_not_seen_for_a_second_has_no_velocity(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/people", MADE.kind(DETECTIONS))
        for time_s in (1.0, 1.5, 3.0):
            data = MADE.encode(DETECTIONS, time_s, *walk(10 * time_s))
            writer.write("/people", data, round(time_s * 1e9))
    _, velocity_mps = recorded_people(tmp_path / "bag")
    known = np.isfinite(velocity_mps).all(axis=1)
    assert known.tolist() == [False] * 3 + [True] * 3 + [False] * 3


def test_a_velocity_is_taken_over_half_a_second_and_a_repeated_message_keeps_it():
    """Detectors are noisy: between two frames of a camera an error of 5 cm would be 1.5 m/s."""
    ids, made = SightedIds(), []
    for time_s, x_m in ((0.0, 0.0), (0.1, 0.3), (0.5, 0.5), (0.5, 0.5), (0.7, 0.5), (0.2, 0.0)):
        place, walk_mps = np.array([[x_m, 0.0]]), np.zeros((1, 2))
        seen = people_of(MADE.message(DETECTIONS, time_s, place, walk_mps))
        made.append(ids.with_velocities(seen, time_s).velocity_mps[0, 0])
    np.testing.assert_allclose(made, [np.nan, 3.0, 1.0, 1.0, 0.0, np.nan], atol=1e-9)


def sighting(time_s, places, velocities, ids=None):
    """A sighting of people."""
    level = np.zeros((len(places), 1))
    people = SeenPeople(
        Header(0, "map"),
        tuple(ids or [""] * len(places)),
        np.hstack([np.reshape(places, (-1, 2)), level]),
        np.hstack([np.reshape(velocities, (-1, 2)), level]),
    )
    return Sighting(time_s, people, str(time_s).encode())


def crossing_walks(n_steps=40, names=None):
    """Two people who walk through each other at 1 m/s, in an order that changes."""
    rng, found = np.random.default_rng(0), []
    for step in range(n_steps):
        t = step / 10
        places, velocities = [[t, 0.0], [4 - t, 0.05]], [[1.0, 0.0], [-1.0, 0.0]]
        order = rng.permutation(2).tolist()
        ids = None if names is None else [names[each] for each in order]
        found.append(
            sighting(t, [places[each] for each in order], [velocities[each] for each in order], ids)
        )
    return found


def test_people_without_ids_are_followed_through_each_other():
    tracks = tracks_of_sightings(crossing_walks())
    assert len(tracks) == 2
    ends = sorted(float(track.position_m[-1, 0] - track.position_m[0, 0]) for track in tracks)
    assert ends == pytest.approx([-3.9, 3.9])
    assert all(len(track.time_s) == 40 for track in tracks)


def test_ids_name_the_tracks():
    tracks = tracks_of_sightings(crossing_walks(names=("anna", "ben")))
    assert {track.agent for track in tracks} == {"anna", "ben"}


def test_a_person_who_jumps_or_was_away_is_another_one():
    still = [sighting(t / 10, [[0.0, 0.0]], [[0.0, 0.0]]) for t in range(5)]
    jumped = [sighting(0.5 + t / 10, [[0.0, 0.6]], [[0.0, 0.0]]) for t in range(5)]
    later = [sighting(3.0 + t / 10, [[0.0, 0.6]], [[0.0, 0.0]]) for t in range(5)]
    assert [len(each.time_s) for each in tracks_of_sightings(still + jumped + later)] == [5, 5, 5]


def test_the_same_message_twice_counts_once_and_numbers_that_are_none_are_left_out():
    walks = crossing_walks()
    broken = sighting(1.05, [[np.nan, 0.0]], [[0.0, 0.0]])
    tracks = tracks_of_sightings([*walks, *walks, broken])
    assert [len(track.time_s) for track in tracks] == [40, 40]


def test_each_person_has_the_others_around():
    crowd = crowd_of_sightings(crossing_walks(names=("anna", "ben")), "here")
    (first,), (none,) = crowd.others_at(0, np.array([1.0])), crowd.others_at(0, np.array([9.0]))
    other = crowd.tracks[1]
    at = np.flatnonzero(other.time_s == 1.0)[0]
    assert first == pytest.approx(other.position_m[[at]])
    assert none.shape == (0, 2)


def test_nobody_who_is_seen_twice_gets_a_sentence():
    with pytest.raises(AppError, match="bag here must hold people who are seen twice at least"):
        crowd_of_sightings([sighting(0.0, [[0.0, 0.0]], [[0.0, 0.0]])], "here")
