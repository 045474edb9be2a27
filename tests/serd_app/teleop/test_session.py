"""A person's episodes: when they begin and end, what is kept, what can be taken back."""

import pytest

from serd_app.drives.episode_spans import DISCARDED, END, SAVED, START, EpisodeMark
from serd_app.errors import TeleopError
from serd_app.teleop.session import EpisodeTally, Session
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

SCENARIO = load_scenario("hallway")
PERIOD_S = SCENARIO.control_period_s
FLOOR, GOAL = (1.5, 1.5), (12.0, 18.0)


def seen(tick, place=FLOOR):
    return observation_at(*place, tick=tick)


@pytest.fixture
def running():
    session = Session(SCENARIO, timeout_s=10.0)
    session.start()
    session.world_reset(100 * PERIOD_S)
    session.observe(seen(100))
    return session


def test_before_the_first_start_there_is_no_episode():
    session = Session(SCENARIO, timeout_s=10.0)
    assert (session.phase, session.outcome, session.duration_s) == ("idle", "", 0.0)
    assert not session.timed_out
    assert not session.is_starting
    assert session.observe(seen(60)) == ()
    for end in (session.save, session.discard):
        with pytest.raises(TeleopError, match=r"no episode to (save|discard); start one"):
            end()


def test_an_observation_that_is_early_by_the_rounding_of_a_clock_starts_the_episode():
    for early_s, n_events in ((1e-6, 1), (1.1e-6, 0)):
        session = Session(SCENARIO, timeout_s=10.0)
        session.start()
        session.world_reset(5.0)
        seen_early = observation_at(*FLOOR, time_s=5.0 - early_s)
        assert len(session.observe(seen_early)) == n_events


def test_an_episode_starts_at_its_first_observation_and_not_at_one_from_before_the_reset():
    session = Session(SCENARIO, timeout_s=10.0)
    session.start()
    assert session.observe(seen(60)) == ()
    session.world_reset(100 * PERIOD_S)
    assert session.observe(seen(61)) == ()
    (event,) = session.observe(seen(100))
    assert (event.event, event.time_s) == (START, 100 * PERIOD_S)
    assert session.observe(seen(101)) == ()


def test_arrival_ends_it_once(running):
    (event,) = running.observe(seen(140, GOAL))
    assert (event.event, event.time_s, event.outcome) == (END, 7.0, "arrived")
    assert running.observe(seen(141, GOAL)) == ()
    assert running.duration_s == pytest.approx(2.0)


def test_the_timeout_ends_it(running):
    events = [event for tick in range(101, 320) for event in running.observe(seen(tick))]
    assert [(event.outcome, event.time_s) for event in events] == [(DISCARDED, 15.0)]
    assert running.timed_out
    with pytest.raises(TeleopError, match="no episode to discard"):
        running.discard()


def test_an_episode_that_timed_out_is_kept_only_when_it_is_saved(running):
    for tick in range(101, 302):
        running.observe(seen(tick))
    event = running.save()
    assert (event.event, event.outcome) == (END, SAVED)
    assert not running.timed_out
    assert running.save() is None


def test_saving_before_the_goal_ends_the_episode_as_saved_at_the_newest_time(running):
    running.observe(seen(120))
    event = running.save()
    assert (event.outcome, event.time_s) == (SAVED, 6.0)


def test_an_arrived_episode_is_saved_already_and_can_be_taken_back_once(running):
    running.observe(seen(140, GOAL))
    assert running.save() is None
    running.observe(seen(200))
    event = running.discard()
    assert (event.event, event.outcome, event.time_s) == (END, DISCARDED, 10.0)
    with pytest.raises(TeleopError, match="no episode to discard; start one first"):
        running.discard()


def test_a_running_episode_can_be_discarded(running):
    running.observe(seen(120))
    assert running.discard().outcome == DISCARDED
    with pytest.raises(TeleopError, match="no episode to save"):
        running.save()


def test_a_second_start_is_refused_until_the_first_has_ended(running):
    refusal = "^an episode is running; save or discard it first$"
    with pytest.raises(TeleopError, match=refusal):
        running.start()
    running.save()
    running.start()
    assert (running.phase, running.outcome) == ("starting", "")
    with pytest.raises(TeleopError, match=refusal):
        running.start()


def test_nothing_can_be_saved_before_the_world_has_been_reset():
    session = Session(SCENARIO, timeout_s=10.0)
    session.start()
    session.world_reset(5.0)
    with pytest.raises(TeleopError, match="no episode to save"):
        session.save()


def test_the_tally_counts_each_episode_by_its_last_end_mark():
    tally = EpisodeTally()
    tally.add(EpisodeMark(START, 0.0, 1, "me", outcome=""))
    assert tally.running.driver == "me"
    tally.add(EpisodeMark(END, 0.0, 1, "me", outcome="arrived"))
    tally.add(EpisodeMark(START, 0.0, 2, "me", outcome=""))
    tally.add(EpisodeMark(END, 0.0, 2, "me", outcome=SAVED))
    tally.add(EpisodeMark(END, 0.0, 1, "me", outcome=DISCARDED))
    assert tally.running is None
    assert (tally.kept, tally.arrived, tally.discarded) == (1, 0, 1)
    assert str(tally) == "1 kept (0 arrived), 1 discarded"


def test_taking_an_episode_back_does_not_end_the_one_that_runs():
    tally = EpisodeTally()
    tally.add(EpisodeMark(END, 0.0, 1, "me", outcome="arrived"))
    tally.add(EpisodeMark(START, 0.0, 2, "you", outcome=""))
    tally.add(EpisodeMark(END, 0.0, 1, "me", outcome=DISCARDED))
    assert tally.running.episode == 2
