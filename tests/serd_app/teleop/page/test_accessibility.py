"""The page by keyboard and screen reader, in light and dark, on a desk and on a phone.

Rules are those of axe-core (Mozilla Public License 2.0, in the package axe-playwright-python).
"""

import threading
from contextlib import contextmanager

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from serd_app.teleop.page.hub import EmergencyStop, Episode, Hold
from serd_app.teleop.page.server import PageAccess, PageServer
from serd_app.teleop.page.view import overlay_of, scene_of, watched_scene_of, world_state
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.browser import DEVICES, SCHEMES, needs_chromium, start_chromium, view, violations
from support.observations import observation_at
from support.waiting import wait_until

HALLWAY = load_scenario("hallway")
PEOPLE = ((1.0, 5.0), (4.4, 9.0))
STATE = {
    "type": "state",
    "world": world_state(observation_at(2.0, 2.0, people=PEOPLE), None),
    "is_stale": False,
    "waypoint": [2.5, 3.5],
    "episode": {"phase": "running", "number": 3, "outcome": "", "duration_s": 12.3, "decisions": 6}
    | {"other_driver": "", "kept": 2, "arrived": 1, "discarded": 0},
    "mux": {"e_stop": "False", "active": "keys"},
    "guard": {"action": "DO_NOTHING", "overridden": "False"},
    "recorder": {"recording": "True", "messages": "1200", "free_mb": "70000"},
    "next_start": None,
    "there": True,
    "mode": "directions",
    "choice": "north",
}
DISCARD = Episode(type="episode", do="discard")
STOP, RELEASE = (EmergencyStop(type="e_stop", engaged=engaged) for engaged in (True, False))
#: Each scheme and each device.
VIEWS = [(SCHEMES[0], *DEVICES[0]), (SCHEMES[1], *DEVICES[1])]

pytestmark = [pytest.mark.slow, needs_chromium]


class ShownPage:
    """A served page without a robot; its state is sent again and again, as by the node."""

    def __init__(self, server, browser, state):
        self.server, self.browser, self.state = server, browser, state

    def show(self, **values):
        self.state = self.state | values

    def focus(self, name):
        selected = f"#{name}, [data-direction={name}], [data-layer={name}]"
        self.browser.execute_script("document.querySelector(arguments[0]).focus()", selected)

    def focused(self):
        active = self.browser.switch_to.active_element
        return active.get_attribute("id") or active.get_attribute("data-direction") or "body"

    def press(self, key):
        ActionChains(self.browser).send_keys(key).perform()

    def until_requested(self, wanted):
        found = []
        wait_until(lambda: found.extend(self.server.take()) or wanted in found)
        return found

    def part(self, name):
        return self.browser.find_element(By.ID, name)

    def text(self, name):
        return self.part(name).get_attribute("textContent")

    def until_text(self, name, beginning):
        wait_until(lambda: self.text(name).startswith(beginning), seen=lambda: self.text(name))


def hold(direction):
    return Hold(type="hold", direction=direction)


@contextmanager
def opened(browser, scene, state):
    """A page of the scene that shows a state; its server, and so its origin, is a new one."""
    server, ended = PageServer(scene, PageAccess("127.0.0.1", ""), 0), threading.Event()
    page = ShownPage(server, browser, state)

    def send():
        while not ended.wait(0.1):
            server.show(page.state | {"page": server.driving_page})

    thread = threading.Thread(target=send)
    thread.start()
    try:
        view(browser, width=1280, height=900, scheme="light")
        browser.get(server.url)
        page.until_text("phase", "episode 3")
        yield page
    finally:
        ended.set()
        thread.join()
        ActionChains(browser).reset_actions()  # releases keys that a failed test holds
        browser.get("about:blank")
        server.close()


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    browser = start_chromium(tmp_path_factory.mktemp("browser"))
    yield browser
    browser.quit()


@pytest.fixture
def shown(browser):
    with opened(browser, scene_of(HALLWAY, grid_of(HALLWAY)), STATE) as page:
        wait_until(page.part("save").is_enabled)  # this page drives
        yield page


@pytest.fixture
def watched(browser):
    scene = watched_scene_of(HALLWAY, grid_of(HALLWAY))
    with opened(browser, scene, STATE | {"recorder": None}) as page:
        yield page


@pytest.fixture
def layers(save_model_of):
    """The layers of a model that is against the flow in two of three lanes."""
    strategy = load_strategy(str(save_model_of()), HALLWAY, "optimal")
    return overlay_of(strategy)


@pytest.fixture
def learned(shown, layers):
    assert not shown.part("overlays").is_displayed()
    shown.server.show_overlay(layers)
    wait_until(shown.part("overlays").is_displayed)
    return shown


def layer_button(shown, name):
    return shown.browser.find_element(By.CSS_SELECTOR, f"[data-layer={name!r}]")


def test_the_page_that_watches_has_no_controls_and_requests_nothing_by_any_key(watched):
    for name in ("start", "pad", "stop"):
        assert not watched.part(name).is_displayed()
    for key in ("s", "d", "r", "m", "g", Keys.ENTER, Keys.ARROW_UP, " "):
        watched.press(key)
    watched.show(episode=STATE["episode"] | {"number": 4})
    watched.until_text("phase", "episode 4")
    assert watched.server.take() == []


@pytest.mark.parametrize(("scheme", "width", "height"), VIEWS)
def test_axe_finds_no_violation_on_the_page_that_watches(watched, scheme, width, height):
    view(watched.browser, width=width, height=height, scheme=scheme)
    assert violations(watched.browser) == []


@pytest.mark.parametrize(("scheme", "width", "height"), VIEWS)
def test_axe_finds_no_violation_while_driving_stopped_and_with_each_layer(
    learned, layers, scheme, width, height
):
    browser = learned.browser
    view(browser, width=width, height=height, scheme=scheme)
    buttons = [each for each in browser.find_elements(By.TAG_NAME, "button") if each.is_displayed()]
    assert {"start", "save", "stop"} <= {each.get_attribute("id") for each in buttons}
    for button in buttons:
        size = button.size
        assert min(size["width"], size["height"]) >= 44, button.get_attribute("outerHTML")
    assert violations(browser) == []
    learned.show(mux={"e_stop": "True"}, recorder={"recording": "False"})
    learned.until_text("stop", "RELEASE")
    assert violations(browser) == []
    for name in ("policy", "arrival"):
        layer_button(learned, name).click()
        learned.until_text("layer-title", layers[name]["title"])
        assert learned.text("layer-note") == layers[name]["note"]
        assert violations(browser) == []


def test_tab_reaches_every_control_that_is_enabled_and_comes_out_again(shown):
    order = []
    for _ in range(20):
        shown.press(Keys.TAB)
        if shown.focused() in order:
            break
        order.append(shown.focused())
    pad = ["north", "west", "east", "south"]
    controls = ["save", "discard", "directions", "velocity", *pad, "stop"]
    assert [name for name in order if name != "body"] == controls


def test_enter_is_for_the_control_in_focus_and_space_stops_wherever_the_focus_is(shown):
    shown.server.take()
    shown.focus("discard")
    shown.press(Keys.ENTER)
    found = shown.until_requested(DISCARD)
    assert [each for each in found if isinstance(each, Episode)] == [DISCARD]
    assert shown.focused() == "discard"
    shown.press(Keys.SPACE)
    assert not [each for each in shown.until_requested(STOP) if isinstance(each, Episode)]
    shown.show(mux={"e_stop": "True"})
    wait_until(lambda: shown.text("alarm") == "Emergency stop. R releases it.")
    shown.show(mux={"e_stop": "False"})
    wait_until(lambda: shown.text("alarm") == "Emergency stop released.")


def test_a_second_click_right_after_the_one_that_stopped_does_not_release(shown):
    def click():
        shown.browser.execute_script("document.getElementById('stop').click()")

    click()
    shown.until_requested(STOP)
    shown.show(mux={"e_stop": "True"})
    shown.until_text("stop", "RELEASE")
    # As if it had been pressed just now, however slow this machine is.
    shown.browser.execute_script("const now = performance.now(); performance.now = () => now")
    shown.press(Keys.SPACE)
    click()
    click()
    shown.browser.execute_script("delete performance.now")
    assert RELEASE not in shown.until_requested(STOP)
    requested = []
    wait_until(lambda: click() or requested.extend(shown.server.take()) or RELEASE in requested)
