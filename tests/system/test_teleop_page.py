"""The web page as a person uses it, in headless Chromium."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from serd_app.demonstrations.demonstrations import demonstrations_of_bag
from serd_app.drives.sessions import read_drives
from serd_core.grid.grid import Action
from serd_ros.convert.command import from_intent
from serd_ros.convert.diagnostics import to_diagnostics
from serd_ros.convert.pose import from_odometry, from_pose
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_ros.graph.graph import find_stack
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.browser import needs_chromium, start_chromium
from support.waiting import PATIENCE_S, ProcessorWait, descendants_of, wait_until
from support.wheeled_robots import STOPPED_MPS

SERD = str(Path(sys.executable).with_name("serd"))
STOPPED_RADPS = 1e-6
SCENARIO = """
name: bend
walkable_area_m: [[0, 0], [3, 0], [3, 2], [6, 2], [6, 5], [0, 5]]
goal_area_m: [[3, 2], [4, 2], [4, 5], [3, 5]]
start_areas_m: {train: [[0, 0], [1, 0], [1, 1], [0, 1]]}
pedestrians:
  count: 2
  warm_up_s: 1.0
  loops:
    - name: beyond the goal
      waypoints_m: [[5, 2.7], [5.4, 2.7], [5.4, 4.3], [5, 4.3]]
      lane_half_width_m: 0.1
"""
FAKE_GAMEPAD = """
const button = (pressed) => ({ pressed, value: Number(pressed) });
window.fake = { id: "test pad", connected: true, axes: [0, -1, 0, 0],
  buttons: Array.from({ length: 17 }, (_, index) => button(index === 4)) };
navigator.getGamepads = () => (window.fake ? [window.fake] : []);
"""

pytestmark = [pytest.mark.ros, pytest.mark.slow, needs_chromium]


class Page:
    """The page in a separate browser."""

    def __init__(self, folder):
        self.browser = start_chromium(folder)

    def open(self, url):
        self.browser.get(url)
        self.wait(lambda: self.text("link") == "connected")

    def part(self, name):
        return self.browser.find_element(By.ID, name)

    def text(self, name):
        return self.part(name).text

    def keys(self):
        return ActionChains(self.browser)

    def press(self, key):
        self.keys().send_keys(key).perform()

    def run(self, script):
        return self.browser.execute_script(script)

    def wait(self, condition):
        wait_until(condition, seen=lambda: (self.text("phase"), self.text("notices")))

    @contextmanager
    def frozen(self):
        """Its processes are stopped, as a page stops whose script hangs."""
        stopped = [
            pid
            for pid in descendants_of(self.browser.service.process.pid)
            if "--type=renderer" in Path(f"/proc/{pid}/cmdline").read_text()
        ]
        assert stopped
        for pid in stopped:
            os.kill(pid, signal.SIGSTOP)
        yield
        for pid in stopped:
            os.kill(pid, signal.SIGCONT)

    def faults(self):
        return [entry for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    page = Page(tmp_path_factory.mktemp("browser"))
    yield page
    page.browser.quit()


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    file = tmp_path_factory.mktemp("scenario") / "bend.yaml"
    file.write_text(SCENARIO)
    return file


class World:
    """What the probe receives of the robot."""

    def __init__(self, probe):
        self.probe = probe
        self.pose, self.speed_mps, self.time_s = None, 0.0, 0.0
        self.moved_s = self.turned_s = 0.0
        self.speeds_mps, self.actions = [], []
        node = probe.node
        node.create_subscription(PoseStamped, "robot_pose", self._take_pose, qos.STATE)
        node.create_subscription(Odometry, "odom", self._take_odometry, qos.STATE)
        node.create_subscription(Vector3Stamped, "intent", self._take_intent, qos.STATE)

    def _take_pose(self, message):
        self.pose = from_pose(message.pose)

    def _take_odometry(self, message):
        self.time_s = stamp_s(message.header.stamp)
        linear_mps, angular_radps = from_odometry(message)[2]
        self.speed_mps = abs(linear_mps)
        self.speeds_mps.append(self.speed_mps)
        if self.speed_mps >= STOPPED_MPS:
            self.moved_s = self.time_s
        if abs(angular_radps) >= STOPPED_RADPS:
            self.turned_s = self.time_s

    def _take_intent(self, message):
        self.actions.append(from_intent(message)[1])

    def until(self, condition):
        self.probe.spin_until(
            lambda: self.pose is not None and condition(),
            seen=lambda: (self.time_s, self.pose, self.speed_mps, self.actions[-9:]),
        )

    def drive_until(self, condition, *, press, release):
        """Press until the condition holds; anew while the robot stands, as a late page stops it.

        A robot that turns towards the next cell does not stand.
        """
        self.probe.spin_all()
        press()
        pressed_s = self.time_s

        def reached():
            nonlocal pressed_s
            if condition():
                return True
            stands = self.speed_mps < STOPPED_MPS
            if stands and self.time_s > max(pressed_s, self.turned_s) + 4.0:
                release()
                press()
                pressed_s = self.time_s
            return False

        self.until(reached)

    @contextmanager
    def stops_within(self, limit_s):
        """What is done inside stops the robot for good; at an obstacle it may stand before.

        limit_s: simulated, plus the time that threads wait for a processor.
        """
        self.probe.spin_all()
        since_s, waited = self.time_s, ProcessorWait()
        yield
        self.until(lambda: self.time_s >= max(self.moved_s, since_s) + 0.4)
        assert self.moved_s - since_s <= limit_s + waited.total_s

    def stands_for(self, duration_s):
        """It stands during so much simulated time from now on."""
        self.probe.spin_all()
        self.speeds_mps.clear()
        self.until_later(duration_s)
        assert max(self.speeds_mps) < STOPPED_MPS

    def until_it_stands(self, duration_s=1.0):
        """Until it has stood for so much simulated time from now on.

        A robot that turns around, or that waits at a wall, stands for a moment too.
        """
        self.probe.spin_all()
        since_s = self.time_s
        self.until(
            lambda: self.time_s >= max(self.moved_s, self.turned_s, since_s) + duration_s,
        )

    def until_later(self, duration_s):
        """Until so much simulated time has passed."""
        since_s = self.time_s
        self.until(lambda: self.time_s > since_s + duration_s)


def test_episodes_driven_and_discarded_on_the_page_are_recorded(
    page, probe, scenario, ros_env, tmp_path
):
    (tmp_path / "teleop_output/session-1").mkdir(parents=True)  # of an earlier run
    command = [SERD, "teleop", "--scenario", str(scenario), "--port", "0", "--json"]
    log = tmp_path / "teleop.log"
    with log.open("wb") as output:
        session = subprocess.Popen(
            command, cwd=tmp_path, env=ros_env, stdout=output, stderr=output,
            start_new_session=True,
        )  # fmt: skip
    try:
        address = re.compile(r"http://[^\s\x1b]+")
        page.wait(lambda: "drive at" in log.read_text() and address.search(log.read_text()))
        world = World(probe)
        page.open(address.search(log.read_text())[0])
        drive_to_the_goal(page, world)
        page.wait(lambda: page.text("arrived") == "1")
        assert page.text("kept") == "1"
        assert page.faults() == []
        n_decisions = int(page.text("decisions").split()[0])
        page.part("start").click()
        page.wait(lambda: page.part("recording").is_displayed())
        page.part("discard").click()
        page.wait(lambda: page.text("discarded") == "1")
        os.killpg(session.pid, signal.SIGINT)  # as Ctrl-C in a terminal
        assert session.wait(PATIENCE_S) == 0, log.read_text()
    finally:
        if session.poll() is None:
            session.terminate()  # not killed, so that it ends its nodes
            session.wait(PATIENCE_S)
    bag = tmp_path / "teleop_output/session-2/bag"
    recorded = json.loads(re.search(r'\{\s+"bag".*', log.read_text(), re.DOTALL)[0])
    assert recorded["outcomes"] == {"arrived": 1, "discarded": 1}
    assert recorded["bag"] == str(bag)
    assert f"serd demos {bag}" in recorded["decisions"]
    check_recording(bag, scenario, n_decisions)


def drive_to_the_goal(page, world):
    """North until the bend, then east, with held arrow keys."""
    page.press(Keys.ENTER)
    page.wait(lambda: page.part("recording").is_displayed())
    hold_until(page, world, Keys.ARROW_UP, lambda: world.pose[1] > 2.2)
    hold_until(page, world, Keys.ARROW_RIGHT, lambda: "arrived" in page.text("phase"))


def hold_until(page, world, key, condition):
    """Hold a key until a condition holds, then release it."""
    world.drive_until(
        condition,
        press=lambda: page.keys().key_down(key).perform(),
        release=lambda: page.keys().key_up(key).perform(),
    )
    page.keys().key_up(key).perform()


def keep_picture(page, folder):
    """A picture of the page; SERD_PICTURES=FOLDER copies it there."""
    picture = folder / "teleop_page.png"
    assert page.browser.save_screenshot(str(picture))
    if "SERD_PICTURES" in os.environ:
        shutil.copy(picture, os.environ["SERD_PICTURES"])


def check_recording(bag, scenario, n_decisions):
    place = load_scenario(scenario)
    assert [span.outcome for span in read_drives(bag)[0].episodes] == ["arrived", "discarded"]
    found, report = demonstrations_of_bag(bag, grid_of(place), place.patience_s, place.wait_s)
    decisions = found.decisions
    assert {Action.NORTH, Action.EAST} <= {Action(each) for each in decisions.action}
    # A page that is late sees several cells entered at once.
    assert 2 <= n_decisions <= report.n_decisions


@pytest.fixture(scope="module")
def stack(running, scenario):
    """The teleop stack without a recorder; the address of its page, and what is received of it."""
    whole = find_stack("teleop")
    names = tuple(name for name in whole.nodes if name != "demo_recorder")
    given = {"scenario": str(scenario), "port": 0, "hallway_sim__people": 0}
    listeners = ["hallway_sim", "local_planner", "teleop_mux"]
    given |= {"teleop_page__required_nodes": listeners}
    given |= {"hallway_sim__required_nodes": ["local_planner"]}
    running.nodes.start_stack(whole.model_copy(update={"nodes": names}), **given)
    address, nodes = re.compile(r"the page is at (http://\S+)"), running.nodes
    wait_until(lambda: address.search(nodes.log_of("teleop_page")))
    return address.search(nodes.log_of("teleop_page"))[1], World(running.probe)


@pytest.fixture
def world(stack):
    stack[1].probe.spin_all()
    stack[1].actions.clear()
    return stack[1]


@pytest.fixture
def driving(stack, page):
    """The page in front, as it is opened first."""
    page.open(stack[0])
    page.part("directions").click()
    page.wait(lambda: page.part("directions").get_attribute("aria-pressed") == "true")
    return page


def test_touch_drives_and_leaving_the_page_or_the_e_stop_stops_the_robot(driving, world):
    page = driving
    north = page.browser.find_element(By.CSS_SELECTOR, "[data-direction=north]")
    world.drive_until(
        lambda: world.speed_mps > 0.25,
        press=lambda: page.keys().click_and_hold(north).perform(),
        release=lambda: page.keys().release().perform(),
    )
    with world.stops_within(1.5):
        page.run("window.dispatchEvent(new Event('blur'))")
    page.wait(lambda: page.text("veil-title") == "The robot stands")
    page.keys().release().perform()

    page.part("veil").click()
    press_anew(page, world, Keys.ARROW_UP, Keys.ARROW_DOWN)
    with world.stops_within(1.5):
        page.press(Keys.SPACE)
    page.wait(lambda: page.text("veil-title") == "Emergency stop")
    assert page.text("stop").startswith("RELEASE")
    n_actions = len(world.actions)
    world.stands_for(A_WHILE_S)  # the key is still held
    assert len(world.actions) == n_actions
    release(page)
    world.stands_for(A_WHILE_S)  # held through the release
    press_anew(page, world, Keys.ARROW_UP, Keys.ARROW_DOWN)
    with world.stops_within(1.5):
        page.press(Keys.SPACE)
    page.keys().key_up(Keys.ARROW_UP).key_down(Keys.ARROW_UP).key_up(Keys.ARROW_UP).perform()
    page.wait(lambda: page.text("veil-title") == "Emergency stop")
    release(page)
    world.stands_for(A_WHILE_S)  # a tap while stopped
    press_anew(page, world, Keys.ARROW_UP, Keys.ARROW_DOWN)
    page.keys().key_up(Keys.ARROW_UP).perform()


A_WHILE_S = 2.5


def release(page):
    page.press("r")
    page.wait(lambda: page.text("stop").startswith("E-STOP"))


def press_anew(page, world, *keys):
    """Press a key again that may be held, and hold it until the robot drives.

    keys: opposite ones, for a late page may have left the robot at a wall.
    """
    ways = cycle(keys)

    def release_all():
        for key in keys:
            page.keys().key_up(key).perform()

    release_all()
    world.drive_until(
        lambda: world.speed_mps > 0.1,
        press=lambda: page.keys().key_down(next(ways)).perform(),
        release=release_all,
    )


def test_a_gamepad_drives_by_velocities_and_a_page_that_closes_stops_the_robot(driving, world):
    page = driving
    page.part("velocity").click()
    page.wait(lambda: page.part("velocity").get_attribute("aria-pressed") == "true")
    page.run(FAKE_GAMEPAD)
    page.wait(lambda: "test pad" in page.text("gamepad"))
    world.stands_for(0.5)  # its stick was deflected from the start
    push_anew(page, world)
    with world.stops_within(1.5):
        page.press(Keys.SPACE)
    page.wait(lambda: page.text("veil-title") == "Emergency stop")
    release(page)
    world.stands_for(1.0)
    push_anew(page, world)
    with world.stops_within(1.5):
        page.run("window.fake.buttons[4] = { pressed: false, value: 0 }")
    page.run("window.fake = null")
    press_anew(page, world, Keys.ARROW_DOWN, Keys.ARROW_UP)
    with page.frozen():
        world.until_it_stands()
    world.stands_for(1.0)
    press_anew(page, world, Keys.ARROW_DOWN, Keys.ARROW_UP)
    with world.stops_within(1.5):
        page.browser.get("about:blank")
    assert world.actions == []


def push_anew(page, world):
    """Return the stick of the gamepad to neutral, then push it until the robot drives.

    Backward where it does not drive forward, for a late page may have left the robot at a wall.
    """
    ways = cycle((-1, 1))  # as browsers count the axis

    def release_stick():
        page.run("window.fake.axes = [0, 0, 0, 0]")
        world.until_later(0.5)

    def push_stick():
        page.run(f"window.fake.axes = [0, {next(ways)}, 0, 0]")

    release_stick()
    world.drive_until(lambda: world.speed_mps > 0.1, press=push_stick, release=release_stick)


def test_buttons_start_save_and_discard_episodes_and_the_best_next_start_is_shown(
    driving, world, tmp_path
):
    page = driving
    kept, discarded = int(page.text("kept")), int(page.text("discarded"))

    def counts():
        return int(page.text("kept")) - kept, int(page.text("discarded")) - discarded

    page.part("start").click()
    page.wait(lambda: page.part("recording").is_displayed())
    page.part("discard").click()
    page.wait(lambda: counts() == (0, 1))
    page.part("start").click()
    page.wait(lambda: page.part("recording").is_displayed())
    page.part("save").click()
    page.wait(lambda: counts() == (1, 1))
    page.press("d")
    page.wait(lambda: counts() == (0, 2))
    assert world.actions == []
    assert not page.part("discard").is_enabled()

    assert not page.part("teaches").is_displayed()
    learner = world.probe.node.create_publisher(DiagnosticArray, "diagnostics", qos.STATE)
    world.probe.spin_until(learner.get_subscription_count)

    def shows_where_a_demonstration_teaches_most():
        values = {"converged": True, "next_x_m": 1.5, "next_y_m": 3.5}
        learner.publish(to_diagnostics("learner", 0.0, values))
        return page.part("teaches").is_displayed()

    page.wait(shows_where_a_demonstration_teaches_most)
    assert page.faults() == []
    keep_picture(page, tmp_path)
