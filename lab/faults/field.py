"""Goals and faults of the reference robots on the stacks of a robot, or on somebody else's guard.

Everything runs in real time, in processes and a ROS domain of its own. The robot, its localisation
and its Nav2 are stand-ins (`lab.faults.standin`): Nav2 is an action server with Nav2's tolerances,
whose commands pass the guard.
"""

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from lab.faults.robots import robot_named
from serd_app.drives.drive import END
from serd_cli.processes.workspace import stack_processes
from serd_ros.convert.diagnostics import from_episode_message, values_of
from serd_ros.convert.motion import to_pose_stamped, to_twist
from serd_ros.endpoints import qos
from serd_ros.graph.graph import find_stack
from serd_sim.errors import SimError
from serd_sim.world.command import Command

STACKS = ("robot", "robot_people", "robot_nav2")
#: Faults of what a robot publishes; those of people and of waypoints have no topic of a robot.
FIELD_FAULTS = (
    "scan_stops", "scan_nan", "scan_inf", "scan_near", "scan_zero", "scan_sector", "scan_frozen",
    "pose_stops", "pose_frozen", "pose_jumps", "odom_stops", "odom_twist", "odom_frozen",
    "delay_1s", "delay_3s",
)  # fmt: skip
#: The guard beside a stack that has none, as in the stack `robot`.
GUARD = find_stack("robot").parameters["guard"] | {"pose_from": "tf"}
MODEL = Path(__file__).resolve().parents[2] / "docs/pictures/demo_model.yaml"
#: A goal, a fault and what follows it may last so long (s).
_GOAL_S, WATCHED_S, _READY_S = 120.0, 9.0, 90.0
#: Places of goals in the hallway (m).
_EAST_M, _NORTH_M = (1.5, 2.5, 3.5, 4.5), (1.5, 2.5, 3.5, 4.5)
_FAST, _COMMAND_S = 0.85, 0.05


@dataclass
class FieldOutcome:
    """What a robot did on a stack.

    Contacts of the outline by the truth. n_false_stops: stops of the guard for an input while no
    fault was made, in `hours` of driving to goals. faults: a row for each, times (s) and way (m)
    from its beginning, None where the robot did not stand within 9 s.
    """

    robot: str
    stack: str
    n_goals: int = 0
    n_arrived: int = 0
    wall: int = 0
    robot_on_person: int = 0
    person_on_robot: int = 0
    n_false_stops: int = 0
    hours: float = 0.0
    false_stops: list[str] = field(default_factory=list)
    endings: list[str] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)


class Field:
    """Watches and drives one robot in a namespace. node: of the caller, spun by `spin`."""

    def __init__(self, node: Node, spin: Callable[[], object], namespace: str) -> None:
        self._node, self._spin, self._namespace = node, spin, namespace
        self.measured: dict[str, Any] = {}
        self.guard: dict[str, str] = {}
        self.endings: list[str] = []
        self.n_begun = 0
        self.stops: list[str] = []
        self._was_stopped = False
        self._goals = node.create_publisher(PoseStamped, self._name("goal_pose"), qos.COMMAND)
        self._disturb = node.create_publisher(String, self._name("disturb"), 10)
        self._drivers: dict[str, Any] = {}
        node.create_subscription(String, self._name("measured"), self._on_measured, 10)
        node.create_subscription(DiagnosticArray, self._name("episode"), self._on_mark, qos.STATE)
        node.create_subscription(
            DiagnosticArray, self._name("diagnostics"), self._on_health, qos.STATE
        )

    def _name(self, topic: str) -> str:
        return f"{self._namespace}/{topic}"

    def _on_measured(self, message: String) -> None:
        self.measured = json.loads(message.data)

    def _on_mark(self, message: DiagnosticArray) -> None:
        mark = from_episode_message(message)
        if mark.event == END:
            self.endings.append(mark.outcome)
        else:
            self.n_begun += 1

    def _on_health(self, message: DiagnosticArray) -> None:
        values = values_of(message, "guard")
        if values is None:
            return
        self.guard = values
        wrong = [
            each
            for each in values["reasons"].split(", ")
            if each and "collision" not in each and not each.startswith("cmd_vel")
        ]
        stopped = values["action"] == "STOP" and bool(wrong)
        if stopped and not self._was_stopped:
            self.stops += wrong
        self._was_stopped = stopped

    def until(self, condition: Callable[[], object], longest_s: float) -> bool:
        """Take messages until a condition holds; whether it did in time."""
        end_s = time.monotonic() + longest_s
        while not condition():
            if time.monotonic() > end_s:
                return False
            self._spin()
        return True

    def send_goal(self, x_m: float, y_m: float) -> bool:
        """Send a goal until its drive begins."""
        n_begun = self.n_begun
        for _ in range(3):
            self._goals.publish(to_pose_stamped((x_m, y_m, 0.0), 0.0))
            if self.until(lambda: self.n_begun > n_begun, 30.0):
                return True
        return False

    def drive_goals(self, count: int, rng: np.random.Generator, outcome: FieldOutcome) -> None:
        """Drive to goals one after the other, each sent at a random phase of the control loop."""
        began_s, n_stops = time.monotonic(), len(self.stops)
        here = (3.5, 1.5)
        for _ in range(count):
            place = here
            while place == here:
                place = float(rng.choice(_EAST_M)), float(rng.choice(_NORTH_M))
            here, n_ended = place, len(self.endings)
            self.until(lambda: False, float(rng.uniform(0.0, 0.3)))
            began = self.send_goal(*place)
            arrived = began and self.until(partial(self._has_ended, n_ended), _GOAL_S)
            outcome.endings.append(self.endings[-1] if arrived else "late")
            outcome.n_arrived += outcome.endings[-1] == "arrived"
        outcome.n_goals += count
        outcome.hours += (time.monotonic() - began_s) / 3600.0
        outcome.false_stops += self.stops[n_stops:]
        outcome.n_false_stops = len(outcome.false_stops)

    def _has_ended(self, n_before: int) -> bool:
        return len(self.endings) > n_before

    def disturb(self, name: str) -> None:
        """Make a fault, until an empty name ends it."""
        is_made = lambda: self.measured.get("fault") == name  # noqa: E731
        for _ in range(20):
            self._disturb.publish(String(data=name))
            if name == "home" or self.until(is_made, 1.0):
                return
        raise SimError(f"the robot does not take the fault {name!r}; look at what runs it")

    def run_fault(self, name: str, fast_mps: float, drive: Callable[[], object]) -> dict[str, Any]:
        """Make a fault at full speed, and measure. drive: keeps the robot driving."""
        row: dict[str, Any] = {"fault": name, "began": 0}

        def is_fast() -> bool:
            drive()
            return abs(float(self.measured.get("speed_mps", 0.0))) >= _FAST * fast_mps

        if not self.until(is_fast, _GOAL_S):
            return row
        before = self._contacts()
        self.disturb(name)

        def stood() -> bool:
            drive()
            return self.measured.get("stood_s") is not None

        self.until(stood, WATCHED_S)
        row |= {key: self.measured.get(key) for key in ("zero_s", "stood_s", "stood_m")}
        after = self._contacts()
        row |= {"began": 1, **{each: after[each] - before[each] for each in after}}
        self.disturb("")
        return row

    def _contacts(self) -> dict[str, int]:
        return {
            each: int(self.measured[each])
            for each in ("wall", "robot_on_person", "person_on_robot")
        }

    def goals_to_and_fro(self) -> Callable[[], None]:
        """What sends the farther end of the hallway as goal when a drive has ended."""
        state = {"ended": -1}

        def drive() -> None:
            if state["ended"] != len(self.endings) and self.measured:
                state["ended"] = len(self.endings)
                self.send_goal(3.5, 13.5 if self.measured["pose"][1] < 7.0 else 1.5)

        return drive

    def ahead(self, topic: str, speed_mps: float) -> Callable[[], None]:
        """What commands full speed ahead, from home where the robot has come far."""
        publisher = self._node.create_publisher(Twist, topic, 10)
        state = {"sent_s": 0.0}

        def drive() -> None:
            now_s = time.monotonic()
            if now_s - state["sent_s"] < _COMMAND_S:
                return
            state["sent_s"] = now_s
            if not self.measured.get("fault") and self.measured.get("pose", (0, 0))[1] > 15.0:
                self.disturb("home")
                self.until(lambda: self.measured["pose"][1] < 10.0, 2.0)
            publisher.publish(to_twist(Command(speed_mps, 0.0)))

        return drive

    def finish(self, outcome: FieldOutcome) -> None:
        """Take the contacts of all."""
        for name, count in self._contacts().items():
            setattr(outcome, name, count)


def standin_options(robot: str, stack: str, seed: int = 0) -> list[str]:
    """Options of the stand-in for a robot on a stack."""
    people = ["--people"] if stack == "robot_people" else []
    # SERD_REAL_NAV2: one that runs already serves the robot's goals, and publishes cmd_vel_raw.
    serves = stack == "robot_nav2" and "SERD_REAL_NAV2" not in os.environ
    nav2 = ["--nav2-output", "cmd_vel_raw"] if serves else []
    return [robot, "--seed", str(seed), *nav2, *people, "--ros-args", "-r", f"__ns:=/{robot}"]


def parameters_of(stack: str, scenario: Path, model: Path) -> dict[str, dict[str, Any]]:
    """By stack to start, its parameters: `robot_nav2` has a guard beside it."""
    shared = {"scenario": str(scenario)}
    found: dict[str, dict[str, Any]] = {
        stack: {**shared, "model": str(model), "strategy.patience_decisions": 0}
    }
    if stack == "robot_nav2":
        found["guard"] = {**shared, **GUARD}
    return found


@contextmanager
def running(
    robot: str, stack: str, folder: Path, environment: Mapping[str, str], model: Path, seed: int
) -> Iterator[None]:
    """The stand-in and the nodes of a stack, as processes whose logs go to a folder."""
    scenario = robot_named(robot).save_scenario(folder)
    commands = {
        "standin": [
            sys.executable,
            "-m",
            "lab.faults.standin",
            *standin_options(robot, stack, seed),
        ]
    }
    for name, given in parameters_of(stack, scenario, model).items():
        for each in stack_processes(find_stack(name), given, environment, f"/{robot}"):
            commands[each.name] = list(each.command)
    with _processes(commands, folder, environment):
        yield


@contextmanager
def _processes(
    commands: Mapping[str, list[str]], folder: Path, environment: Mapping[str, str]
) -> Iterator[None]:
    started = []
    try:
        for name, command in commands.items():
            with (folder / f"{name}.log").open("ab") as log:
                started.append(
                    subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)
                )
        yield
    finally:
        for each in started:
            each.terminate()
        for each in started:
            with suppress(subprocess.TimeoutExpired):
                each.wait(10.0)
            each.kill()
            each.wait()


@contextmanager
def field_of(namespace: str, domain: int) -> Iterator[Field]:
    """A field with a node of its own in a ROS domain."""
    context = Context()
    context.init(domain_id=domain)
    executor = SingleThreadedExecutor(context=context)
    try:
        node = Node("field", context=context)
        executor.add_node(node)
        yield Field(node, lambda: executor.spin_once(timeout_sec=0.02), namespace)
        executor.shutdown()
        node.destroy_node()
    finally:
        context.try_shutdown()


def run_field(
    robot: str,
    stack: str,
    folder: Path,
    environment: Mapping[str, str],
    *,
    n_goals: int,
    faults: Sequence[str],
    model: Path = MODEL,
    seed: int = 0,
) -> FieldOutcome:
    """Goals and faults of a robot on a stack. environment: with ROS_DOMAIN_ID."""
    outcome, kind = FieldOutcome(robot, stack), robot_named(robot)
    folder.mkdir(parents=True, exist_ok=True)
    domain = int(environment["ROS_DOMAIN_ID"])
    with (
        running(robot, stack, folder, environment, model, seed),
        field_of(f"/{robot}", domain) as seen,
    ):
        if not seen.until(lambda: _is_ready(folder) and seen.measured, _READY_S):
            raise SimError(f"the stack {stack} does not start; read the logs in {folder}")
        seen.drive_goals(n_goals, np.random.default_rng(seed), outcome)
        drive = seen.goals_to_and_fro()
        for name in faults:
            outcome.faults.append(seen.run_fault(name, kind.max_vel_x_mps, drive))
        seen.finish(outcome)
    return outcome


def _is_ready(folder: Path) -> bool:
    log = folder / "strategy.log"
    return log.is_file() and "waiting for a goal" in log.read_text()


def run_guard(
    robot: str,
    topics: tuple[str, str],
    folder: Path,
    environment: Mapping[str, str],
    faults: Sequence[str],
    seed: int = 0,
) -> FieldOutcome:
    """Faults of a robot before a guard that runs already: it takes commands and publishes others.

    topics: of the commands that it takes, and of those that reach the robot, in full. Its inputs
    are `odom`, `scan` and /tf in the namespace of the robot.
    """
    raw, out = topics
    outcome, kind = FieldOutcome(robot, f"{raw}:{out}"), robot_named(robot)
    folder.mkdir(parents=True, exist_ok=True)
    options = [robot, "--seed", str(seed), "--cmd-vel", out]
    command = [
        sys.executable, "-m", "lab.faults.standin", *options,
        "--ros-args", "-r", f"__ns:=/{robot}",
    ]  # fmt: skip
    domain = int(environment.get("ROS_DOMAIN_ID", "0"))
    with (
        _processes({"standin": command}, folder, environment),
        field_of(f"/{robot}", domain) as seen,
    ):
        drive = seen.ahead(raw, kind.max_vel_x_mps)
        for name in faults:
            outcome.faults.append(seen.run_fault(name, kind.max_vel_x_mps, drive))
        if not any(each["began"] for each in outcome.faults):
            raise SimError(
                f"the robot {robot} never reached its speed; does the guard take {raw} and publish"
                f" {out}, and does it get /{robot}/odom, /{robot}/scan and /{robot}/tf?"
            )
        seen.finish(outcome)
    return outcome


def field_rows(outcome: FieldOutcome) -> dict[str, Any]:
    """The numbers of an outcome without its lists, and of its faults the slowest."""
    stood = [each["stood_s"] for each in outcome.faults if each.get("stood_s") is not None]
    lists = ("false_stops", "endings", "faults")
    found = {key: value for key, value in asdict(outcome).items() if key not in lists}
    found["n_faults"] = sum(each["began"] for each in outcome.faults)
    return found | {"n_stood": len(stood), "largest_stood_s": max(stood, default=math.nan)}
