"""`serd teleop` and its web page as a person uses them, in headless Chromium."""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.drives.sessions import read_drives
from serd_core.grid.grid import Action
from serd_ros.convert.diagnostics import to_diagnostics
from serd_ros.convert.motion import from_odometry, from_pose
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.browser import needs_chromium, start_chromium
from support.waiting import PATIENCE_S, ProcessorWait, children_of, wait_until
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
window.fake = { id: "test pad", connected: true, axes: [0, 0, 0, 0],
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

    def set_mode(self, mode):
        self.part(mode).click()
        self.wait(lambda: self.part(mode).get_attribute("aria-pressed") == "true")

    def release_e_stop(self):
        self.wait(lambda: self.text("veil-title") == "Emergency stop")
        self.press("r")
        self.wait(lambda: self.text("stop").startswith("E-STOP"))

    def faults(self):
        return [entry for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]


@pytest.fixture
def page(tmp_path):
    page = Page(tmp_path)
    yield page
    page.browser.quit()


class Robot:
    """What the probe receives of the robot that the page drives."""

    def __init__(self, probe, page):
        self.probe, self.page = probe, page
        self.speed_mps = self.time_s = self.moved_s = self.turned_s = self.y_m = 0.0
        probe.subscribe(Odometry, "odom", self._take_odometry)
        probe.subscribe(PoseStamped, "robot_pose", self._take_pose)

    def _take_odometry(self, message):
        self.time_s = stamp_s(message.header.stamp)
        linear_mps, angular_radps = from_odometry(message)[2]
        self.speed_mps = abs(linear_mps)
        if self.speed_mps >= STOPPED_MPS:
            self.moved_s = self.time_s
        if abs(angular_radps) >= STOPPED_RADPS:
            self.turned_s = self.time_s

    def _take_pose(self, message):
        self.y_m = from_pose(message.pose)[1]

    def until(self, condition):
        self.probe.spin_until(
            condition, seen=lambda: (self.time_s, self.speed_mps, self.page.text("phase"))
        )

    def drive_until(self, condition, *, press, release):
        """Press until the condition holds; anew while the robot stands, as a late page stops it.

        A robot that turns towards the next cell does not stand.
        """
        release()
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

    def hold(self, *keys, until=None):
        """Hold a key until a condition holds, by default until the robot drives.

        keys: opposite ones, for a late page may have left the robot at a wall.
        """
        ways, drives = cycle(keys), lambda: self.speed_mps > 0.1

        def release():
            for key in keys:
                self.page.keys().key_up(key).perform()

        press = lambda: self.page.keys().key_down(next(ways)).perform()  # noqa: E731
        self.drive_until(until or drives, press=press, release=release)
        return release

    def until_later(self, duration_s):
        since_s = self.time_s
        self.until(lambda: self.time_s > since_s + duration_s)

    @contextmanager
    def stops_within(self, limit_s, stands_s=0.4):
        """What is done inside stops the robot for good; at an obstacle it may stand before.

        limit_s: simulated, plus the time that threads wait for a processor.
        """
        self.probe.spin_all()
        since_s, waited = self.time_s, ProcessorWait()
        yield
        self.until(lambda: self.time_s >= max(self.moved_s, since_s) + stands_s)
        assert self.moved_s - since_s <= limit_s + waited.total_s


@pytest.fixture
def session(ros_env, tmp_path):
    """`serd teleop` in a process group of its own, as a terminal starts it, and its log."""
    (tmp_path / "bend.yaml").write_text(SCENARIO)
    (tmp_path / "teleop_output/session-1").mkdir(parents=True)  # of an earlier run
    log, command = tmp_path / "teleop.log", ["--scenario", "bend.yaml", "--port", "0", "--json"]
    with log.open("wb") as output:
        process = subprocess.Popen(
            [SERD, "teleop", *command], cwd=tmp_path, env=ros_env, stdout=output, stderr=output,
            start_new_session=True,
        )  # fmt: skip
    yield process, log
    if process.poll() is None:
        process.terminate()  # not killed, so that it ends its nodes
        process.wait(PATIENCE_S)


def test_a_person_drives_on_the_page_stops_the_robot_in_every_way_and_records(
    page, probe, session, tmp_path
):
    process, log = session
    page.wait(lambda: "drive at" in log.read_text())
    page.open(re.search(r"http://[^\s\x1b]+", log.read_text())[0])
    robot, vertical = Robot(probe, page), (Keys.ARROW_UP, Keys.ARROW_DOWN)

    north = page.browser.find_element(By.CSS_SELECTOR, "[data-direction=north]")
    robot.drive_until(
        lambda: robot.speed_mps > 0.25,
        press=lambda: page.keys().click_and_hold(north).perform(),
        release=lambda: page.keys().release().perform(),
    )
    with robot.stops_within(1.5):
        page.run("window.dispatchEvent(new Event('blur'))")
    page.wait(lambda: page.text("veil-title") == "The robot stands")
    page.keys().release().perform()
    page.part("veil").click()
    robot.hold(*vertical)
    with robot.stops_within(1.5, stands_s=2.5):
        page.press(Keys.SPACE)  # the key is still held
    page.release_e_stop()
    release, silent = robot.hold(*vertical), node_of(process, "teleop_page")
    with robot.stops_within(1.5):
        os.kill(silent, signal.SIGSTOP)
    os.kill(silent, signal.SIGCONT)
    robot.until_later(1.0)
    assert robot.speed_mps < STOPPED_MPS  # the held key counts after it was pressed anew
    release()
    robot.hold(*vertical)()

    page.set_mode("velocity")
    page.run(FAKE_GAMEPAD)
    page.wait(lambda: "test pad" in page.text("gamepad"))
    ways = cycle((-1, 1))  # as browsers count the axis; backward where it does not drive forward
    robot.drive_until(
        lambda: robot.speed_mps > 0.1,
        press=lambda: page.run(f"window.fake.axes = [0, {next(ways)}, 0, 0]"),
        release=lambda: page.run("window.fake.axes = [0, 0, 0, 0]") or robot.until_later(0.5),
    )
    with robot.stops_within(1.5):
        page.run("window.fake.buttons[4] = { pressed: false, value: 0 }")
    page.run("window.fake = null")
    page.set_mode("directions")

    drive_to_the_goal(page, robot)
    assert page.text("kept") == "1"
    n_decisions = int(page.text("decisions").split()[0])
    page.part("start").click()
    page.wait(lambda: page.part("recording").is_displayed())
    page.part("discard").click()
    page.wait(lambda: page.text("discarded") == "1")
    show_where_a_demonstration_teaches_most(page, probe)
    assert page.faults() == []

    os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C in a terminal
    assert process.wait(PATIENCE_S) == 0, log.read_text()
    bag = tmp_path / "teleop_output/session-2/bag"
    recorded = json.loads(re.search(r'\{\s+"bag".*', log.read_text(), re.DOTALL)[0])
    assert recorded["outcomes"] == {"arrived": 1, "discarded": 1}
    assert recorded["bag"] == str(bag)
    assert f"serd demos {bag}" in recorded["decisions"]
    check_recording(bag, load_scenario(tmp_path / "bend.yaml"), n_decisions)


def node_of(process, name):
    """The process of a node that the session has started, each under a keeper."""
    for keeper in children_of(process.pid):
        for each in children_of(keeper):
            if name in Path(f"/proc/{each}/cmdline").read_text():
                return each
    raise LookupError(name)


def drive_to_the_goal(page, robot):
    """North until the bend, then east, with held arrow keys."""
    page.press(Keys.ENTER)
    page.wait(lambda: page.part("recording").is_displayed())
    release = robot.hold(Keys.ARROW_UP, until=lambda: robot.y_m > 2.2)
    release()
    robot.hold(Keys.ARROW_RIGHT, until=lambda: "arrived" in page.text("phase"))()
    page.wait(lambda: page.text("arrived") == "1")


def show_where_a_demonstration_teaches_most(page, probe):
    assert not page.part("teaches").is_displayed()
    learner = probe.node.create_publisher(DiagnosticArray, "diagnostics", qos.STATE)
    probe.spin_until(learner.get_subscription_count)

    def shown():
        values = {"converged": True, "next_x_m": 1.5, "next_y_m": 3.5}
        learner.publish(to_diagnostics("learner", 0.0, values))
        return page.part("teaches").is_displayed()

    page.wait(shown)


def check_recording(bag, place, n_decisions):
    assert [span.outcome for span in read_drives(bag)[0].episodes] == ["arrived", "discarded"]
    found, report = demonstrations_of_bag(bag, grid_of(place), place.patience_s, place.wait_s)
    assert {Action.NORTH, Action.EAST} <= {Action(each) for each in found.action}
    # A page that is late sees several cells entered at once.
    assert 2 <= n_decisions <= report.n_decisions
