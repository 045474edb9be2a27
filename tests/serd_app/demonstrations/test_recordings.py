"""Recordings of one place, each read by the mapping that fits it."""

import numpy as np

from serd_app.demonstrations.flow_field import recorded_sightings
from serd_app.demonstrations.recorded import read_recordings
from serd_bag.reader import BagReader
from serd_core.demonstrations.decisions import HIDDEN
from support.foreign_bags import START_S, ForeignBag, Robot, key_presses
from support.people_messages import CLOUD, PeopleMessages

PLACE_M, VELOCITY_MPS = np.array([[3.0, 1.0]]), np.array([[0.5, 0.0]])


def test_people_of_a_bag_of_poses_alone_are_brought_into_the_frame_of_the_poses(messages, tmp_path):
    """A localisation moves the odometry, in which both the robot and the people are, by 2 m."""
    track = Robot().drive(key_presses(np.random.default_rng(7)), 70.0)
    drift = np.zeros_like(track)
    drift[:, 0], drift[:, 1] = track[:, 0], np.linspace(0.0, 2.0, len(track))
    bag, people = ForeignBag(messages), PeopleMessages()
    bag.add_odometry("/odom", track)
    bag.add_tf("/tf", track, "odom", "chassis")
    bag.add_tf("/tf", drift, "site", "odom")
    seen_s = np.arange(5.0, 60.0, 5.0)
    for time_s in seen_s:
        sighting = people.encode(CLOUD, START_S + time_s, PLACE_M, VELOCITY_MPS, frame="odom")
        bag.add("/pedestrians", CLOUD, time_s, sighting)
    path = bag.write(tmp_path / "bag")
    found = read_recordings([path], mapping=None, scenario=None)
    assert found.people.frame == "site"
    assert (found.drives[0].intent_action == HIDDEN).all()
    sightings = recorded_sightings(BagReader(path), found.people.people_topic, frame="site")
    places_m = np.concatenate([each.people.position_m[:, :2] for each in sightings])
    shift_m = np.interp(seen_s, drift[:, 0], drift[:, 1])
    np.testing.assert_allclose(places_m, PLACE_M + np.c_[shift_m, 0 * shift_m], atol=1e-3)
