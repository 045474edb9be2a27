"""People of messages as tracks."""

import numpy as np
import pytest

from serd_app.drives.recorded_people import Sighting, crowd_of_sightings, tracks_of_sightings
from serd_app.errors import AppError
from serd_bag.messages.people import SeenPeople
from serd_bag.messages.plain import Header


def seen(time_s, places, velocities, ids=None):
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
            seen(t, [places[each] for each in order], [velocities[each] for each in order], ids)
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
    still = [seen(t / 10, [[0.0, 0.0]], [[0.0, 0.0]]) for t in range(5)]
    jumped = [seen(0.5 + t / 10, [[0.0, 0.6]], [[0.0, 0.0]]) for t in range(5)]
    later = [seen(3.0 + t / 10, [[0.0, 0.6]], [[0.0, 0.0]]) for t in range(5)]
    assert [len(each.time_s) for each in tracks_of_sightings(still + jumped + later)] == [5, 5, 5]


def test_the_same_message_twice_counts_once_and_numbers_that_are_none_are_left_out():
    walks = crossing_walks()
    broken = seen(1.05, [[np.nan, 0.0]], [[0.0, 0.0]])
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
        crowd_of_sightings([seen(0.0, [[0.0, 0.0]], [[0.0, 0.0]])], "here")
