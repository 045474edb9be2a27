"""A person's episodes: when they begin and end, what is kept, what can be taken back."""

import pytest

from serd_app.drives.drive import DISCARDED, END, SAVED, START, EpisodeMark
from serd_app.errors import TeleopError
from serd_app.teleop.session import EpisodeTally, Session
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

SCENARIO = load_scenario("hallway")
PERIOD_S = SCENARIO.control_period_s
FLOOR, GOAL = (1.5, 1.5), (12.0, 18.0)


def seen(tick, place=FLOOR):
    return observation_at(*place, tick=tick)


def begun(reset_s=100 * PERIOD_S):
    session = Session(SCENARIO, timeout_s=10.0)
    session.start()
    session.world_reset(reset_s)
    return session


@pytest.fixture
def running():
    session = begun()
    session.observe(seen(100))
    return session


def refuses(session, *requests):
    for request in requests:
        with pytest.raises(
            TeleopError, match=f"^there is no episode to {request}; start one first"
        ):
            getattr(session, request)()


def test_before_the_first_start_there_is_no_episode():
    session = Session(SCENARIO, timeout_s=10.0)
    assert (session.phase, session.outcome, session.duration_s) == ("idle", "", 0.0)
    assert not session.timed_out
    assert not session.is_starting
    assert session.observe(seen(60)) == ()
    refuses(session, "save", "discard")


def test_an_episode_starts_at_its_first_observation_and_not_at_one_from_before_the_reset():
    session = Session(SCENARIO, timeout_s=10.0)
    session.start()
    assert session.observe(seen(60)) == ()
    session.world_reset(100 * PERIOD_S)
    refuses(session, "save")
    assert session.observe(seen(61)) == ()
    assert session.is_starting
    (event,) = session.observe(seen(100))
    assert (event.event, event.time_s) == (START, 100 * PERIOD_S)
    assert not session.is_starting
    assert session.observe(seen(101)) == ()
    for early_s, n_events in ((1e-6, 1), (1.1e-6, 0)):  # the rounding of a clock
        assert len(begun(5.0).observe(observation_at(*FLOOR, time_s=5.0 - early_s))) == n_events


def test_arrival_ends_it_once_and_it_is_saved_already_but_can_be_taken_back_once(running):
    (event,) = running.observe(seen(140, GOAL))
    assert (event.event, event.time_s, event.outcome) == (END, 7.0, "arrived")
    assert running.observe(seen(141, GOAL)) == ()
    assert running.duration_s == pytest.approx(2.0)
    assert running.save() is None
    running.observe(seen(200))
    event = running.discard()
    assert (event.event, event.outcome, event.time_s) == (END, DISCARDED, 10.0)
    refuses(running, "discard", "save")


def test_the_timeout_discards_an_episode_unless_it_is_saved(running):
    events = [event for tick in range(101, 320) for event in running.observe(seen(tick))]
    assert [(event.outcome, event.time_s) for event in events] == [(DISCARDED, 15.0)]
    assert running.timed_out
    refuses(running, "discard")
    event = running.save()
    assert (event.event, event.outcome) == (END, SAVED)
    assert not running.timed_out
    assert running.save() is None


@pytest.mark.parametrize(("end", "outcome"), [("save", SAVED), ("discard", DISCARDED)])
def test_an_episode_that_runs_ends_at_the_newest_time_as_requested(running, end, outcome):
    running.observe(seen(120))
    event = getattr(running, end)()
    assert (event.outcome, event.time_s) == (outcome, 6.0)


def test_a_second_start_is_refused_until_the_first_has_ended(running):
    refusal = "^an episode is running; save or discard it first$"
    with pytest.raises(TeleopError, match=refusal):
        running.start()
    running.save()
    running.start()
    assert (running.phase, running.outcome) == ("starting", "")
    with pytest.raises(TeleopError, match=refusal):
        running.start()


def test_the_tally_counts_each_episode_by_its_last_end_mark_and_knows_the_one_that_runs():
    tally = EpisodeTally()
    for number, outcome in ((1, ""), (1, "arrived"), (2, "")):
        tally.add(EpisodeMark(END if outcome else START, 0.0, number, "me", outcome=outcome))
    assert (tally.running.episode, tally.running.driver, tally.arrived) == (2, "me", 1)
    tally.add(EpisodeMark(END, 0.0, 1, "me", outcome=DISCARDED))
    assert tally.running.episode == 2
    tally.add(EpisodeMark(END, 0.0, 2, "me", outcome=SAVED))
    assert tally.running is None
    assert (tally.kept, tally.arrived, tally.discarded) == (1, 0, 1)
    assert str(tally) == "1 kept (0 arrived), 1 discarded"
