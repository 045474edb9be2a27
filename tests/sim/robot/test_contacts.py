"""Contacts counted: who ran into whom, each bump once, and the smallest gap of the episode."""

from types import SimpleNamespace

import numpy as np
import pytest

from serd_sim.crowd.robots import RobotBody
from serd_sim.robot.contacts import ContactCounter, ContactCounts, Touches

FAR_FROM_WALLS_M = 5.0


class Crowd(SimpleNamespace):
    """What the counter asks of a crowd."""

    def __len__(self):
        return len(self.x_m)


def one_person(x_m, velocity_x_mps=0.0):
    """A person in front of the robot, on its line."""
    return Crowd(
        x_m=np.array([x_m]),
        y_m=np.zeros(1),
        velocity_x_mps=np.array([velocity_x_mps]),
        velocity_y_mps=np.zeros(1),
        body_radius_m=0.25,
    )


def robot(velocity_x_mps=0.0):
    return RobotBody(0.0, 0.0, velocity_x_mps, 0.0, 0.25)


@pytest.mark.parametrize(
    ("robots_mps", "persons_mps", "who"),
    [
        (0.5, 0.4, "robot"),  # it catches up with a person who walks away
        (0.5, -0.4, "robot"),  # both approach, the robot faster
        (0.4, -0.5, "person"),  # both approach, the person faster
        (-0.3, -0.5, "person"),  # the person catches up with a robot that backs off
        (0.0, 0.0, "person"),  # a robot at rest does not run into people
    ],
)
def test_a_contact_is_of_the_one_who_closes_in_faster(robots_mps, persons_mps, who):
    counter = ContactCounter(1)
    counter.update(one_person(0.49, persons_mps), robot(robots_mps), FAR_FROM_WALLS_M)
    counted = counter.counts.robot_on_person, counter.counts.person_on_robot
    assert counted == (who == "robot", who == "person")


def test_a_bump_that_trembles_counts_once_and_one_after_parting_again():
    counter = ContactCounter(1)
    counted, gaps_m = [], []
    for x_m in (0.8, 0.49, 0.52, 0.49, 0.53, 0.45, 0.56, 0.49):
        counter.update(one_person(x_m), robot(), FAR_FROM_WALLS_M)
        counted.append(counter.counts.person_on_robot)
        gaps_m.append(counter.minimum_distance_m)
    assert counted == [0, 1, 1, 1, 1, 1, 1, 2]
    assert gaps_m == pytest.approx([0.3, *[-0.01] * 4, *[-0.05] * 3])


def test_alone_the_robot_touches_walls_only():
    counter = ContactCounter(0)
    empty = Crowd(x_m=np.zeros(0))
    for distance_m in (0.3, 0.24, 0.26, 0.24, 0.4, 0.24):
        counter.update(empty, robot(0.5), distance_m)
    assert counter.counts.robot_on_wall == 2
    assert counter.minimum_distance_m == np.inf


def test_touches_of_the_physics_count_as_they_are():
    """Circles that overlap do not; a person 3 cm away has bounced off within the period."""
    counter = ContactCounter(1)
    counter.update(one_person(0.49), robot(), 0.24, Touches({}, False))
    assert counter.counts == ContactCounter(1).counts
    for people, wall, x_m in (
        ({0: True}, False, 0.53),
        ({}, False, 0.52),
        ({0: False}, False, 0.5),  # still the same contact
        ({}, False, 0.6),
        ({0: False}, True, 0.5),
    ):
        counter.update(one_person(x_m), robot(), FAR_FROM_WALLS_M, Touches(people, wall))
    assert counter.counts == ContactCounts(1, 1, 1)
