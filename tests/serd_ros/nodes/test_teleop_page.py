"""Driving by directions: which intents the page's node publishes, and what counts as a decision."""

from contextlib import contextmanager

import pytest

from serd_app.teleop.page.requests import Hold
from serd_core.grid.grid import Action
from serd_ros.convert.command import from_intent
from serd_ros.convert.diagnostics import to_diagnostics
from serd_ros.convert.pose import to_odometry, to_pose_stamped
from serd_ros.convert.sensors import to_people_message
from serd_ros.convert.stamp import stamp_s
from serd_sim.episodes.result import EpisodeStart
from support.nodes_in_process import node_in_process
from support.observations import observation_at

BEGIN_S, TICK_S = 50.0, 0.05


class Person:
    """Sends heartbeats of a page; `drive` lets time pass in a world with the robot at a place."""

    def __init__(self, running, monkeypatch):
        self.running, self.node = running, running.node
        self.requests = []
        taken = lambda: [self.requests.pop(0) for _ in self.requests[:1]]  # noqa: E731
        monkeypatch.setattr(self.node._server, "take", taken)
        self.time_s = BEGIN_S
        self.intents = []
        publish = self.node._intents.publish

        def keep(message):
            publish(message)
            self.intents.append((stamp_s(message.header.stamp), from_intent(message)[1]))

        self.node._intents.publish = keep

    def beat(self, direction, after_s=TICK_S):
        self.requests.append(Hold(type="hold", direction=direction))
        self.running.wait(after_s)
        self.running.call_timers()

    def drive(self, direction, y_m, to_y_m=None, duration_s=1.0):
        """Hold a direction while the robot goes from one place to another."""
        n_ticks = round(duration_s / TICK_S)
        for tick in range(n_ticks):
            self.beat(direction)
            share = tick / n_ticks
            self.observe(y_m if to_y_m is None else y_m + share * (to_y_m - y_m))

    def observe(self, y_m):
        self.time_s = round(self.time_s + TICK_S, 3)
        seen = observation_at(2.5, y_m, 1.5, time_s=self.time_s)
        self.running.receive("diagnostics", to_diagnostics("teleop_mux", self.time_s, {}))
        self.running.receive("pedestrians", to_people_message(seen.people, self.time_s))
        self.running.receive("odom", to_odometry(seen, (0.0, 0.0, 0.0)))
        self.running.receive("robot_pose", to_pose_stamped(seen.pose, self.time_s))

    def begin_episode(self):
        """The world is reset after a gap of its clock."""
        self.node.episodes.session.start()
        self.time_s += 10.0
        start = EpisodeStart(episode=0, seed=0, start_area="train", start_s=self.time_s)
        self.node.episodes._starter.begin(start)

    @property
    def actions(self):
        return [action for _, action in self.intents]


@contextmanager
def person_at_page(monkeypatch):
    with node_in_process("teleop_page", port=0) as running:
        yield Person(running, monkeypatch)
        running.assert_alive()


def test_a_held_direction_is_published_once_in_each_cell_and_release_stops(monkeypatch):
    with person_at_page(monkeypatch) as person:
        person.drive(None, 3.5)
        person.drive("north", 3.5, 7.0, duration_s=4.0)
        person.drive(None, 7.0)
        north, wait = Action.NORTH, Action.WAIT
        assert person.actions == [north, north, north, north, wait]
        crossed_s = [later - BEGIN_S for later, _ in person.intents[1:4]]
        # The hysteresis is a tenth of a cell; the robot drives at 0.875 m/s.
        assert crossed_s == pytest.approx(
            [1.0 + (y_m - 3.5) / 0.875 for y_m in (4.1, 5.1, 6.1)], abs=0.1
        )
        assert person.intents[-1][0] == pytest.approx(BEGIN_S + 5.05)


def test_a_blocked_robot_gets_the_held_direction_again_after_patience(monkeypatch):
    with person_at_page(monkeypatch) as person:
        person.drive("north", 3.5, duration_s=9.0)
        assert person.actions == [Action.NORTH] * 3
        since_s = [time_s - person.intents[0][0] for time_s, _ in person.intents]
        assert since_s == pytest.approx([0.0, 4.0, 8.0])


def test_decisions_count_from_the_first_direction_on_with_waits_of_a_second(monkeypatch):
    with person_at_page(monkeypatch) as person:
        person.drive(None, 3.5)
        person.begin_episode()
        person.drive(None, 3.5, duration_s=3.0)
        assert (person.node.episodes.n_decisions, person.actions) == (0, [])
        person.drive("north", 3.5, duration_s=1.0)
        assert person.node.episodes.n_decisions == 1
        person.drive(None, 3.5, duration_s=2.5)
        assert person.node.episodes.n_decisions == 4
        assert person.actions == [Action.NORTH, Action.WAIT, Action.WAIT, Action.WAIT]


@pytest.mark.parametrize(("held_s", "n_decisions"), [(0.2, 1), (0.4, 2)])
def test_a_key_that_is_held_for_a_moment_drives_and_is_no_decision(
    held_s, n_decisions, monkeypatch
):
    with person_at_page(monkeypatch) as person:
        person.drive(None, 3.5)
        person.begin_episode()
        person.drive("north", 3.5)
        person.drive("east", 3.5, duration_s=held_s)
        assert person.actions == [Action.NORTH, Action.EAST]
        assert person.node.episodes.n_decisions == n_decisions


def test_a_key_that_is_held_while_the_stack_starts_counts_once_it_runs(monkeypatch):
    """Without a heartbeat before in which nothing was held, and while the process is late."""
    with person_at_page(monkeypatch) as person:
        for after_s in (0.05, 0.05, 0.8, 0.05, 1.5, 0.05):
            person.beat("north", after_s)
        assert person.actions == []
        person.drive("north", 3.5, 4.3)
        assert person.actions == [Action.NORTH, Action.NORTH]
        assert not person.running.sent["driver_gone"].data


def test_a_key_that_is_held_while_an_episode_begins_decides_at_its_first_observation(monkeypatch):
    with person_at_page(monkeypatch) as person:
        person.drive(None, 3.5)
        person.drive("north", 3.5)
        person.begin_episode()
        person.drive("north", 8.5)
        assert person.actions == [Action.NORTH, Action.NORTH]
        assert person.intents[1][0] == pytest.approx(BEGIN_S + 12.05)
        assert person.node.episodes.n_decisions == 1
