"""Waypoints as goals of Nav2, against a stand-in for its action server; no real one is tested."""

import pytest

from serd_app.navigation.nav2_goals import CANCELED, SUCCEEDED, Nav2Goals
from serd_core.errors import SerdError
from serd_ros.convert.motion import odom_in_map
from serd_ros.nodes.nav2_bridge import ros_type
from serd_sim.safety.motion import compose
from support.nav2_server import Handle, Nav2Server, answered

ABORTED = 6
HERE, THERE = ([(1.0, y_m, 0.0)] for y_m in (2.0, 3.0))


@pytest.fixture
def server():
    return Nav2Server()


@pytest.fixture
def goals(server):
    return Nav2Goals(server, lambda targets, time_s: (tuple(targets), time_s), timeout_s=5.0)


def places(server):
    return [list(targets) for targets, _ in server.goals]


@pytest.mark.parametrize("old_ends_first", [True, False])
def test_a_new_waypoint_replaces_the_goal_and_the_end_of_the_old_one_changes_nothing(
    server, goals, old_ends_first
):
    goals.take(HERE, 0.0, 0.0)
    old = server.answer()
    goals.take(THERE, 2.0, 2.0)
    if old_ends_first:
        old.end(ABORTED)
    new = server.answer()
    if not old_ends_first:
        old.end(ABORTED)
    assert (goals.state, new.canceled, len(server.goals)) == ("driving", False, 2)
    new.end(SUCCEEDED)
    assert goals.state == "arrived"


@pytest.mark.parametrize("taken", [[HERE, THERE, THERE], [HERE, THERE, HERE]])
def test_of_waypoints_that_come_while_one_is_sent_only_the_newest_is_sent_after_it(
    server, goals, taken
):
    for targets in taken:
        goals.take(targets, 0.0, 0.0)
    assert len(server.goals) == 1
    handle = server.answer()
    assert places(server) == ([HERE, THERE] if taken[-1] == THERE else [HERE])
    if taken[-1] == HERE:
        handle.end(SUCCEEDED)
        assert goals.state == "arrived"


@pytest.mark.parametrize(
    ("state", "status", "code"),
    [
        ("rejected", None, 0),
        ("failed with code 105", ABORTED, 105),
        ("failed without a code (another client's goal may have replaced it)", ABORTED, 0),
        ("canceled by another client", CANCELED, 0),
    ],
)
def test_after_a_failure_the_next_waypoint_tries_again(server, goals, state, status, code):
    goals.take(HERE, 0.0, 0.0)
    handle = server.answer(accepted=status is not None)
    if status is not None:
        handle.end(status, error_code=code)
    assert goals.state == state
    goals.take(HERE, 2.0, 2.0)
    assert len(server.goals) == 2


def test_silence_stops_nav2_also_where_the_newest_goal_was_rejected(server, goals):
    goals.take(HERE, 0.0, 0.0)
    older = server.answer()
    assert not goals.expire(4.9)
    goals.take(THERE, 5.0, 5.0)
    server.answer(accepted=False)
    assert not goals.expire(9.9)
    assert not older.canceled
    assert goals.expire(10.1)
    assert older.canceled
    assert not goals.expire(11.0)


def test_a_request_without_an_answer_is_sent_again_and_its_late_goal_is_canceled(server, goals):
    goals.take(HERE, 0.0, 0.0)
    goals.take(HERE, 4.9, 4.9)
    assert len(server.goals) == 1
    goals.expire(5.1)
    assert goals.state == "no answer"
    goals.take(HERE, 5.2, 5.2)
    assert len(server.goals) == 2
    late = Handle(accepted=True)
    answered(server.answers[0], late)
    assert (late.canceled, goals.state) == (True, "sent")
    assert not server.answer().canceled
    assert goals.state == "driving"


@pytest.mark.parametrize("seen_gone", [True, False])
def test_a_server_that_comes_back_gets_the_same_waypoint_again(server, goals, seen_gone):
    server.ready = False
    goals.take(HERE, 0.0, 0.0)
    assert (goals.state, server.goals) == ("no server", [])
    server.ready = True
    goals.take(HERE, 0.0, 0.0)
    lost = server.answer()
    server.ready = False
    if seen_gone:
        assert not goals.expire(0.5)
        assert not goals.expire(100.0)  # nothing to cancel
    else:
        goals.take(HERE, 1.0, 1.0)
    assert (goals.state, lost.canceled) == ("no server", False)
    server.ready = True
    goals.take(HERE, 102.0, 102.0)
    assert len(server.goals) == 2
    found = server.answer()
    assert goals.state == "driving"
    assert goals.expire(107.1)
    assert (lost.canceled, found.canceled) == (False, True)


def test_map_to_odom_and_odom_to_base_together_are_the_pose_in_the_map():
    base_in_map, base_in_odom = (3.0, -1.0, 2.0), (0.5, 0.7, -1.5)
    odom = odom_in_map(base_in_map, base_in_odom)
    assert compose(odom, base_in_odom) == pytest.approx(base_in_map)


def test_a_missing_ros_package_is_named_with_the_fix():
    with pytest.raises(SerdError, match="apt-get install ros-jazzy-no-such-msgs"):
        ros_type("no_such_msgs.action", "NavigateToPose")
