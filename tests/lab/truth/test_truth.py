"""The stand-in moves and sees as geometry says, and contradicted headlines are found."""

import numpy as np
import pytest

from lab.truth.judge import Verdict, contradiction, judge
from lab.truth.stand_in import STEP_S, Rover, recorded, walls_of
from lab.truth.worlds import FAMILIES, claim
from serd_core.arrival.law import ArrivalLaw

ROOM = walls_of([(-2.0, -1.0), (3.0, -1.0), (3.0, 1.0), (-2.0, 1.0)])


class Still:
    """A generator without noise."""

    def standard_normal(self, size):
        return np.zeros(size)


def test_equal_wheels_drive_straight_unequal_ones_on_a_circle_and_walls_stop():
    rover = Rover(np.zeros((0, 4)), Still(), command=(0.4, 0.2))
    places = []
    for _ in range(round(2 * np.pi / 0.2 / STEP_S) + 40):
        rover.step()
        places.append(rover.pose[:2])
    size_m = np.ptp(places[40:], axis=0)
    np.testing.assert_allclose(size_m, 2 * 0.4 / 0.2, rtol=0.01)  # radius v / w
    np.testing.assert_allclose(rover.pose, rover.odometry)
    straight = Rover(ROOM, Still(), command=(0.5, 0.0))
    for _ in range(400):
        straight.step()
    assert 2.7 < straight.pose[0] < 3.0 - 0.18
    assert straight.odometry[0] == pytest.approx(straight.pose[0], abs=0.05)


def test_rays_end_at_the_walls_of_a_room_and_nowhere_without_walls():
    rover = Rover(ROOM, Still())
    rover.pose = np.array([0.5, 0.2, 0.3])
    angles = 0.3 + np.linspace(-np.pi, np.pi, 180, endpoint=False)
    ends = rover.pose[:2] + rover.scan()[:, None] * np.stack(
        [np.cos(angles), np.sin(angles)], axis=1
    )
    away = np.minimum(
        np.abs(ends[:, 0] - np.array([[-2.0], [3.0]])).min(axis=0),
        np.abs(np.abs(ends[:, 1]) - 1.0),
    )
    assert away.max() < 1e-9
    assert np.isinf(Rover(np.zeros((0, 4)), Still()).scan()).all()


def test_a_pilot_arrives_at_each_place_and_pauses():
    rover = Rover(ROOM, np.random.default_rng(0))
    log = recorded(rover, [[(1.5, 0.0, 2.0), (0.0, 0.0, 0.0)]], 0.5)
    reached = np.hypot(log.odometry[:, 0] - 1.5, log.odometry[:, 1]) < 0.2
    assert 15 <= (reached & (log.command == 0).all(axis=1)).sum() <= 40
    assert np.hypot(*log.odometry[-1, :2]) < 0.25
    np.testing.assert_allclose(np.diff(log.time_s), 2 * STEP_S)


class Strategy:
    """One cell, with a law of arrival that is even between 10 and 30 s in a share of drives."""

    def __init__(self, share):
        self.problem = type("", (), {"grid": type("", (), {"n_states": 1})})
        times_s = np.linspace(0.0, 60.0, 601)
        self._law = ArrivalLaw(times_s, share * np.clip((times_s - 10) / 20, 0, 1), share)

    def law_from(self, _):
        return self._law


@pytest.mark.parametrize(
    ("share", "times_s", "found"),
    [
        (1.0, [12.0, 15.0, 18.0, 21.0, 24.0, 27.0], ""),
        (0.95, [12.0, 15.0, 18.0, np.inf, np.inf, np.inf], "3 of 6 arrive, where 95% are claimed"),
        (1.0, [40.0] * 6, "6 of 6 are outside the band"),
        (0.5, [12.0, 15.0, 18.0, np.inf, np.inf, np.inf], ""),
    ],
)
def test_rollouts_that_contradict_a_headline_are_found(share, times_s, found):
    said = contradiction(Strategy(share), np.zeros(3, dtype=np.int64), np.array(times_s))
    assert said.startswith(found)
    assert bool(said) == bool(found)
    assert any(
        "DISAGREES" in line for line in Verdict("a", "b", True, disagrees=said).lines()
    ) == bool(found)


def test_a_single_drive_of_a_foreign_robot_is_no_claim(tmp_path):
    verdict = judge("one", tmp_path)
    assert not verdict.claims
    assert "needed to learn" in verdict.headline or "no claim but counts" in verdict.headline


def test_a_claim_of_a_world_has_its_truth_beside_it():
    found = claim("ring", 0)
    assert found.family in FAMILIES
    assert found.share_true == pytest.approx(1.0, abs=0.05)
    assert 2.0 < found.half_true_s < 60.0
    assert bool(found.claimed) == (not found.failed)
