"""Which intents and velocities the page's node publishes, and what counts as a decision."""

import pytest
from std_msgs.msg import Bool, String

from serd_app.teleop.page.hub import Away, EmergencyStop, Episode, Hold, Move
from serd_core.grid.grid import Action
from serd_ros.convert.diagnostics import to_diagnostics
from serd_ros.convert.motion import from_intent
from serd_ros.convert.stamp import stamp_s
from serd_ros.nodes.watch_page import episode_values
from serd_sim.episodes.episode import EpisodeStart
from support.nodes_in_process import node_in_process
from support.observations import observation_at
from support.valid_messages import valid_message
from support.waiting import wait_until

BEGIN_S, TICK_S = 50.0, 0.05
NORTH, EAST, WAIT = Action.NORTH, Action.EAST, Action.WAIT
STOP, RELEASE = (EmergencyStop(type="e_stop", engaged=each) for each in (True, False))


class Person:
    """Sends heartbeats of a page; `drive` lets time pass in a world with the robot at a place."""

    def __init__(self, running, monkeypatch):
        self.running, self.node, self.episodes = running, running.node, running.node.episodes
        self._requests, self.time_s, self.intents = [], BEGIN_S, []
        monkeypatch.setattr(self.node._server, "take", self._take)
        publish = self.node._intents.publish

        def keep(message):
            publish(message)
            self.intents.append((stamp_s(message.header.stamp), from_intent(message)[1]))

        self.node._intents.publish = keep

    def _take(self):
        taken, self._requests = self._requests, []
        return taken

    def beat(self, request, after_s=TICK_S):
        """A request of the page, or the direction that is held."""
        if request is None or isinstance(request, str):
            request = Hold(type="hold", direction=request)
        self._requests.append(request)
        self.running.wait(after_s)
        self.running.call_timers()

    def drive(
        self, direction, y_m=3.5, to_y_m=None, *, duration_s=1.0, world=True, mux=True, active="in"
    ):
        """Hold a direction while the robot goes from one place to another.

        world, mux: whether they send messages; active: the input of the mux.
        """
        n_ticks = round(duration_s / TICK_S)
        for tick in range(n_ticks):
            self.beat(direction)
            if mux:
                self.hear_mux(active)
            if world:
                share = tick / n_ticks
                self.observe(y_m if to_y_m is None else y_m + share * (to_y_m - y_m))

    def hear_mux(self, active="in"):
        values = {"active": active}
        self.running.receive("diagnostics", to_diagnostics("teleop_mux", self.time_s, values))

    def observe(self, y_m=3.5):
        self.time_s = round(self.time_s + TICK_S, 3)
        self.running.observe(observation_at(2.5, y_m, 1.5, time_s=self.time_s))

    def begin_episode(self):
        """The world is reset after a gap of its clock."""
        self.episodes.session.start()
        self.time_s += 10.0
        start = EpisodeStart(episode=0, seed=0, start_area="train", start_s=self.time_s)
        self.episodes._starter.begin(start)

    def press_anew(self, direction, **look):
        self.drive(None, duration_s=0.8)
        self.drive(direction, **look)

    @property
    def actions(self):
        return [action for _, action in self.intents]

    @property
    def is_gone(self):
        return self.running.sent["driver_gone"].data


@pytest.fixture
def person(monkeypatch):
    with node_in_process("teleop_page", port=0) as running:
        yield Person(running, monkeypatch)
        running.assert_alive()


@pytest.fixture
def driver(person):
    """A person who drives north in an episode."""
    person.drive(None)
    person.begin_episode()
    person.drive("north")
    assert person.actions == [NORTH]
    return person


def test_a_held_direction_is_published_once_in_each_cell_and_release_stops(person):
    person.drive(None)
    person.drive("north", 3.5, 7.0, duration_s=4.0)
    person.drive(None, 7.0)
    assert person.actions == [NORTH, NORTH, NORTH, NORTH, WAIT]
    crossed_s = [later - BEGIN_S for later, _ in person.intents[1:4]]
    # The hysteresis is a tenth of a cell; the robot drives at 0.875 m/s.
    expected_s = [1.0 + (y_m - 3.5) / 0.875 for y_m in (4.1, 5.1, 6.1)]
    assert crossed_s == pytest.approx(expected_s, abs=0.1)
    assert person.intents[-1][0] == pytest.approx(BEGIN_S + 5.05)


def test_decisions_count_from_the_first_direction_on_with_waits_of_a_second(person):
    person.drive(None)
    person.begin_episode()
    person.drive(None, duration_s=3.0)
    assert (person.episodes.n_decisions, person.actions) == (0, [])
    person.drive("north")
    assert person.episodes.n_decisions == 1
    person.drive(None, duration_s=2.5)
    assert person.episodes.n_decisions == 4
    assert person.actions == [NORTH, WAIT, WAIT, WAIT]


@pytest.mark.parametrize(("held_s", "n_decisions"), [(0.2, 1), (0.4, 2)])
def test_a_key_that_is_held_for_a_moment_drives_and_is_no_decision(held_s, n_decisions, driver):
    driver.drive("east", duration_s=held_s)
    assert driver.actions == [NORTH, EAST]
    assert driver.episodes.n_decisions == n_decisions


def test_a_key_that_is_held_while_an_episode_begins_decides_at_its_first_observation(person):
    person.drive(None)
    person.drive("north")
    person.begin_episode()
    assert episode_values(person.episodes)["phase"] == "starting"
    person.drive("north", 8.5)
    assert episode_values(person.episodes)["phase"] == "running"
    assert person.actions == [NORTH, NORTH]
    assert person.intents[1][0] == pytest.approx(BEGIN_S + 12.05)
    assert person.episodes.n_decisions == 1


def test_a_page_stops_after_a_jump_forward_and_keeps_its_episode(driver):
    driver.time_s += 5.0
    driver.observe()
    assert driver.actions[-1] is WAIT
    assert driver.node.choice.action is WAIT
    assert driver.episodes.is_running
    driver.press_anew("east")
    assert driver.actions[-1] is EAST


def test_a_page_begins_a_new_session_after_a_jump_backward(driver):
    driver.running.receive("episode", valid_message("episode", driver.time_s))
    driver.time_s = 10.0
    driver.observe()
    assert driver.actions[-1] is WAIT
    assert driver.episodes.session.phase == "idle"
    assert driver.episodes.tally.running is None
    assert driver.episodes.n_decisions == 0
    driver.episodes.session.start()


@pytest.mark.parametrize("silent", ["mux", "world"])
def test_a_held_key_counts_anew_after_mux_or_world_were_silent(silent, driver):
    heard = {silent: False}
    driver.drive("north", duration_s=0.9, **heard)
    assert driver.actions[-1] is NORTH
    assert not driver.is_gone
    driver.drive("north", **heard)
    driver.drive("north", duration_s=0.1)
    assert driver.actions[-1] is WAIT
    assert driver.node.choice.action is WAIT


def test_a_key_pressed_in_the_e_stop_drives_neither_before_the_mux_confirms_it_nor_after_it(driver):
    driver.beat(STOP)
    driver.press_anew("north")
    assert driver.actions[-1] is WAIT
    driver.running.receive("e_stop_engaged", Bool(data=True))
    driver.press_anew("north")
    driver.beat(RELEASE)
    driver.drive("north")
    driver.running.receive("e_stop_engaged", Bool(data=False))
    driver.drive("north")
    assert driver.actions[-1] is WAIT
    assert driver.is_gone
    driver.press_anew("north")
    assert driver.actions[-1] is NORTH


@pytest.mark.parametrize(
    "event",
    [
        STOP, Episode(type="episode", do="discard"), Episode(type="episode", do="save"),
        Away(type="away"), "planner restarts",
    ],
    ids=["e-stop", "discard", "save", "connection lost", "planner restarts"],
)  # fmt: skip
def test_a_key_that_is_held_all_the_time_drives_again_only_when_it_is_pressed_anew(event, driver):
    if event == "planner restarts":
        driver.drive("north", duration_s=0.75, active="")
    else:
        driver.beat(event)
        driver.observe()
    if event == STOP:
        driver.running.receive("e_stop_engaged", Bool(data=True))
        driver.drive("north", duration_s=2.0)
        assert driver.actions[-1] is WAIT
        driver.beat(RELEASE)
        driver.running.receive("e_stop_engaged", Bool(data=False))
    before = len(driver.actions)
    driver.drive("north", duration_s=4.5)
    assert driver.actions[-1] is WAIT
    assert set(driver.actions[before:]) <= {WAIT}
    assert len(driver.actions) <= before + 5  # to wait, once a second
    assert driver.is_gone
    driver.press_anew("north")
    assert driver.actions[-1] is NORTH
    assert not driver.is_gone


@pytest.mark.parametrize("silent_s", [0.45, 0.55])
def test_a_held_key_moves_on_only_after_a_pause_of_the_page_in_which_the_mux_did_not_stop(
    silent_s, person
):
    """The mux stops the robot after 0.5 s; the page's next request may be taken at once after."""

    def beat(linear, after_s=0.1):
        person.beat(Move(type="move", linear=linear, angular=0.0), after_s)
        return person.running.sent["cmd_vel_teleop"].linear.x > 0.0

    person.node.set_mode("velocity")
    person.running.sent["cmd_vel_teleop"] = valid_message("cmd_vel", 0.0).twist
    beat(0.0)
    assert beat(1.0)
    person.running.wait(0.2)
    person.running.call_timers()
    driven = person.running.published["cmd_vel_teleop"]
    drives_on = beat(1.0, silent_s - 0.2)
    assert (drives_on and person.running.published["cmd_vel_teleop"] > driven) == (silent_s < 0.5)
    beat(0.0)
    assert beat(1.0)


def test_the_page_has_the_layers_of_the_newest_model_and_a_bad_one_changes_nothing(
    save_model_of, monkeypatch
):
    text, shown = save_model_of().read_text(), []
    with node_in_process("watch_page", port=0) as running:
        monkeypatch.setattr(running.node._server, "show_overlay", shown.append)
        running.receive("model", String(data=text))
        wait_until(lambda: shown)
        (layers,) = shown
        assert len(layers["arrival"]["labels"]) == len(layers["policy"]["directions"])
        for bad in (text.replace("discount: 0.99", "discount: 7"), "scenario: hallway", "]"):
            running.receive("model", String(data=bad))
        running.node.close()  # which waits for what is being solved
        assert len(shown) == 1
        running.assert_alive()


def test_the_page_follows_a_stack_and_its_node_publishes_its_health_alone():
    with node_in_process("watch_page", port=0) as running:
        for topic in ("pedestrians", "odom", "episode", "robot_pose", "intent"):
            running.receive(topic, valid_message(topic, 10.0))
        state = running.node._view.watched_state(running.node.wall_s())
        robot = valid_message("robot_pose", 10.0).pose.position
        assert state["world"]["robot"][:2] == [robot.x, robot.y]
        assert len(state["world"]["people"]) == 2
        assert (state["is_stale"], state["episode"]["phase"]) == (False, "running")
        assert state["episode"]["other_driver"]
        own = {"/diagnostics", "/rosout", "/parameter_events"}
        assert {each.topic_name for each in running.node.publishers} <= own
        assert not list(running.node.clients)
        running.assert_alive()
