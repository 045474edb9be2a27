"""The open pages without a connection: who drives, what is requested, what waits for each page."""

import json
from types import SimpleNamespace

import pytest

from serd_app.teleop.page.hub import SILENCE_S, Away, EmergencyStop, Episode, Hold, Hub

NORTH = Hold(type="hold", direction="north")
STOP_ALL = EmergencyStop(type="e_stop", engaged=True)
RELEASE = EmergencyStop(type="e_stop", engaged=False)
AWAY = Away(type="away")
START = Episode(type="episode", do="start")
REFUSAL = {"type": "notice", "text": "another page is driving; close it first"}


@pytest.fixture
def clock():
    return SimpleNamespace(now_s=0.0)


@pytest.fixture
def hub(clock):
    return Hub('{"type": "scene"}', clock=lambda: clock.now_s)


@pytest.fixture
def pages(hub):
    """Two pages that have read their greeting, of which the first drives."""
    pages = hub.open(), hub.open()
    request(hub, pages[0], NORTH)
    for page in pages:
        page.pending()
    return pages


def requests_of(hub):
    return [hub.requests.get_nowait() for _ in range(hub.requests.qsize())]


def sent_to(page):
    return [json.loads(message) for message in page.pending()]


def request(hub, page, *requests):
    for each in requests:
        hub.receive(page, each.model_dump_json())


def test_a_page_renews_its_right_to_drive_with_each_request_until_it_is_silent(hub, pages, clock):
    driver, other = pages
    for now_s, page, driving in (
        (SILENCE_S, driver, driver),
        (2 * SILENCE_S, other, driver),
        (2 * SILENCE_S + 0.01, other, other),
    ):
        clock.now_s = now_s
        request(hub, page, NORTH)
        assert hub.driving == driving.number


def test_pages_are_greeted_with_their_number_the_scene_and_the_newest_layers(hub):
    for number in (1, 2):
        page = hub.open()
        assert (page.number, page.changed.is_set()) == (number, True)
        assert sent_to(page) == [{"type": "hello", "page": number}, {"type": "scene"}]
    hub.send_overlay('{"number": 1}')
    hub.send_overlay('{"number": 2}')
    assert sent_to(page) == [{"number": 2}]
    assert sent_to(hub.open())[2:] == [{"number": 2}]


def test_a_slow_page_gets_its_greeting_its_last_notices_and_only_the_newest_state(hub):
    page = hub.open()
    for number in range(1000):
        hub.send_notice(str(number))
        hub.send_overlay("overlay")
        hub.send_state(f"state {number}")
    messages = page.pending()
    assert '"hello"' in messages[0]
    assert json.loads(messages[2]) == {"type": "notice", "text": "950"}
    assert messages[-3:] == ['{"type": "notice", "text": "999"}', "overlay", "state 999"]
    assert len(messages) == 2 + 50 + 2
    assert page.pending() == []


def test_the_requests_of_the_driving_page_come_in_order_and_nothing_else(hub):
    page = hub.open()
    hub.send_state("{}")
    assert hub.driving is None
    request(hub, page, NORTH, START, RELEASE, STOP_ALL)
    hub.send_state("{}")
    assert hub.driving == 1
    assert requests_of(hub) == [NORTH, START, RELEASE, STOP_ALL]
    assert sent_to(page)[2:] == [{}]


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
def test_what_another_page_requests_is_refused_and_only_presses_are_answered(
    hub, pages, refused, answer
):
    driver, other = pages
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


def test_a_driver_that_is_away_is_away_once_and_the_next_page_drives(hub, pages):
    driver, other = pages
    request(hub, other, AWAY)
    assert hub.driving == driver.number
    request(hub, driver, AWAY, AWAY)
    assert hub.driving is None
    assert requests_of(hub) == [NORTH, AWAY]
    request(hub, other, NORTH)
    assert hub.driving == other.number


def test_a_page_that_closes_is_away_once_if_it_drove_and_gets_nothing_more(hub, pages):
    driver, other = pages
    hub.close(other)
    assert (hub.driving, requests_of(hub)) == (driver.number, [NORTH])
    hub.send_notice("going")
    hub.close(driver)
    hub.close(driver)
    assert (hub.driving, requests_of(hub)) == (None, [AWAY])
    hub.send_notice("gone")
    assert sent_to(driver) == [{"type": "notice", "text": "going"}]
    assert sent_to(other) == []
