"""The open pages without a connection: who drives, what is requested, what waits for each page."""

import json

import pytest

from serd_app.teleop.page.hub import SILENCE_S, Hub, Lease
from serd_app.teleop.page.requests import Away, EmergencyStop, Episode, Hold

NORTH = Hold(type="hold", direction="north")
STOP_ALL = EmergencyStop(type="e_stop", engaged=True)
RELEASE = EmergencyStop(type="e_stop", engaged=False)
AWAY = Away(type="away")
START = Episode(type="episode", do="start")
REFUSAL = {"type": "notice", "text": "another page is driving; close it first"}


class Clock:
    """A monotonic clock that the test sets."""

    now_s = 0.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def hub(clock):
    return Hub('{"type": "scene"}', clock=clock)


def requests_of(hub):
    return [hub.requests.get_nowait() for _ in range(hub.requests.qsize())]


def sent_to(page):
    return [json.loads(message) for message in page.pending()]


def request(hub, page, *requests):
    for each in requests:
        hub.receive(page, each.model_dump_json())


def test_one_page_drives_until_it_goes_or_is_silent():
    lease = Lease()
    assert lease.claim(1, 0.0)
    assert not lease.claim(2, 0.1)
    assert lease.claim(1, SILENCE_S)
    assert not lease.claim(2, 2 * SILENCE_S)
    assert lease.claim(2, 2 * SILENCE_S + 0.01)
    lease.release(1)
    assert lease.holder(2 * SILENCE_S + 0.02) == 2
    lease.release(2)
    assert lease.holder(2 * SILENCE_S + 0.02) is None


def test_pages_are_numbered_from_one_and_greeted_with_their_number_and_the_scene(hub):
    for number in (1, 2, 3):
        page = hub.open()
        assert page.number == number
        assert page.changed.is_set()
        assert sent_to(page) == [{"type": "hello", "page": number}, {"type": "scene"}]


def test_layers_wait_for_the_open_pages_and_the_newest_ones_for_later_pages(hub):
    early = hub.open()
    early.pending()
    hub.send_overlay('{"number": 1}')
    hub.send_overlay('{"number": 2}')
    assert sent_to(early) == [{"number": 2}]
    assert sent_to(hub.open())[2:] == [{"number": 2}]


def test_a_slow_page_gets_its_notices_but_only_the_newest_state(hub):
    page = hub.open()
    page.pending()
    hub.send_notice("one")
    hub.send_state("old")
    hub.send_notice("two")
    hub.send_state("new")
    assert page.pending() == [
        '{"type": "notice", "text": "one"}',
        '{"type": "notice", "text": "two"}',
        "new",
    ]
    assert page.pending() == []


def test_a_page_that_never_reads_keeps_its_greeting_and_few_other_messages(hub):
    page = hub.open()
    for number in range(1000):
        hub.send_notice(str(number))
        hub.send_overlay("overlay")
        hub.send_state("state")
    messages = page.pending()
    assert '"hello"' in messages[0]
    assert messages[-3:] == ['{"type": "notice", "text": "999"}', "overlay", "state"]
    assert len(messages) == 2 + 50 + 2


def test_each_message_wakes_the_sender_once(hub):
    page = hub.open()
    for send in (hub.send_state, hub.send_notice, hub.send_overlay):
        page.pending()
        assert not page.changed.is_set()
        send("{}")
        assert page.changed.is_set()


def test_the_requests_of_the_driving_page_come_in_order_and_nothing_else(hub):
    page = hub.open()
    hub.send_state("{}")
    assert hub.driving is None
    request(hub, page, NORTH, START, RELEASE, STOP_ALL)
    hub.send_state("{}")
    assert hub.driving == 1
    assert requests_of(hub) == [NORTH, START, RELEASE, STOP_ALL]
    assert sent_to(page)[2:] == [{}]


def test_a_bad_message_is_answered_to_its_page_alone_and_makes_it_no_driver(hub):
    bad, other = hub.open(), hub.open()
    bad.pending(), other.pending()
    hub.receive(bad, '{"type": "hold"}')
    (notice,) = sent_to(bad)
    assert notice["type"] == "notice"
    assert notice["text"].startswith("hold.direction of a page's request: ")
    assert notice["text"].endswith("; load the page again")
    assert sent_to(other) == requests_of(hub) == []
    assert hub.driving is None


@pytest.mark.parametrize(
    ("refused", "answer"),
    [
        ({"type": "episode", "do": "start"}, [REFUSAL]),
        ({"type": "e_stop", "engaged": False}, [REFUSAL]),
        ({"type": "mode", "mode": "velocity"}, [REFUSAL]),
        ({"type": "hold", "direction": "north"}, []),
        ({"type": "move", "linear": 1.0, "angular": 0.0}, []),
    ],
)
def test_what_another_page_requests_is_refused_and_only_presses_are_answered(hub, refused, answer):
    driver, other = hub.open(), hub.open()
    request(hub, driver, NORTH)
    driver.pending(), other.pending()
    hub.receive(other, json.dumps(refused))
    assert (hub.driving, requests_of(hub)) == (driver.number, [NORTH])
    assert sent_to(other) == answer
    assert sent_to(driver) == []


def test_any_page_may_stop_the_robot_and_does_not_drive_by_it(hub):
    driver, other = hub.open(), hub.open()
    request(hub, other, STOP_ALL)
    assert hub.driving is None
    request(hub, driver, NORTH)
    request(hub, other, STOP_ALL)
    assert hub.driving == driver.number
    assert requests_of(hub) == [STOP_ALL, NORTH, STOP_ALL]


def test_a_driver_that_is_away_is_away_once_and_the_next_page_drives(hub):
    driver, other = hub.open(), hub.open()
    request(hub, driver, NORTH)
    request(hub, other, AWAY)
    assert hub.driving == driver.number
    request(hub, driver, AWAY, AWAY)
    assert hub.driving is None
    assert requests_of(hub) == [NORTH, AWAY]
    request(hub, other, NORTH)
    assert hub.driving == other.number


def test_a_page_that_closes_is_away_once_if_it_drove_and_gets_nothing_more(hub):
    driver, other = hub.open(), hub.open()
    request(hub, driver, NORTH)
    driver.pending(), other.pending()
    hub.close(other)
    assert (hub.driving, requests_of(hub)) == (driver.number, [NORTH])
    hub.send_notice("going")
    hub.close(driver)
    hub.close(driver)
    assert (hub.driving, requests_of(hub)) == (None, [AWAY])
    hub.send_notice("gone")
    assert sent_to(driver) == [{"type": "notice", "text": "going"}]
    assert sent_to(other) == []


def test_a_silent_driver_is_away_once_it_has_been_silent_for_longer_than_the_limit(hub, clock):
    page = hub.open()
    request(hub, page, NORTH)
    clock.now_s = SILENCE_S
    hub.send_state("{}")
    assert hub.driving == page.number
    clock.now_s = SILENCE_S + 0.01
    hub.send_state("{}")
    hub.send_state("{}")
    assert hub.driving is None
    assert requests_of(hub) == [NORTH, AWAY]
